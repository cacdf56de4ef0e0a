// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/pipeline/case.h"

namespace helicarm::pipeline {

/// Whether the image's name holds {frame}.
bool is_numbered(const CaseView& view);

/// Whether a view of the case is.
bool is_sequence(const Case& the_case);

/// The view at an image's number: in its file's name {frame} or, with leading zeros, {frame:03d} is replaced
/// by it; an image without it is a file with several frames, the first of which is 1. Fails with bad_value
/// for another form of {frame}.
Expected<CaseView> at_number(CaseView view, int number);

/// All views at a frame of the sequence: their numbers are the frame and the view's `frame_offset`.
Expected<Case> at_frame(Case the_case, int frame);

}  // namespace helicarm::pipeline
