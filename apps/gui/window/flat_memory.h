// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <malloc.h>

namespace helicarm::gui {

/// Returns freed memory to the system at once and lets threads share their heaps, because images are
/// allocated in many threads for hours. Call before the first thread.
inline void keep_memory_flat() {
#ifdef __GLIBC__
  // NOLINTBEGIN(concurrency-mt-unsafe): there is no other thread yet.
  mallopt(M_ARENA_MAX, 2);
  mallopt(M_MMAP_THRESHOLD, 1 << 20);
  mallopt(M_TRIM_THRESHOLD, 1 << 20);
  // NOLINTEND(concurrency-mt-unsafe)
#endif
}

}  // namespace helicarm::gui
