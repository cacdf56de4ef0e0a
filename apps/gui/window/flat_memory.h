// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <malloc.h>

namespace helicarm::gui {

/// Images come and go in many threads for hours: their memory goes back to the system at once, and threads
/// share their heaps. To be called before the first of them.
inline void keep_memory_flat() {
#ifdef __GLIBC__
  mallopt(M_ARENA_MAX, 2);
  mallopt(M_MMAP_THRESHOLD, 1 << 20);
  mallopt(M_TRIM_THRESHOLD, 1 << 20);
#endif
}

}  // namespace helicarm::gui
