// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/core/codec_reader.h"
#include "helicarm/core/codec_schema.h"
#include "helicarm/core/codec_writer.h"

/// One description of a JSON object gives its reader, its writer and its schema:
///
///     template <class Codec, class Line>
///     void describe(Codec& codec, Line& line) {
///       codec.text("name", line.name, "of the line, unique");
///       codec.number("length_mm", line.length_mm, {0, 500}, "from end to end");
///     }
///
/// `FromJson` sets the values, `ToJson` takes them, `ToSchema` needs only what they are. An unset optional
/// value is not written. Each key has a help text, in the words of docs/formats.md.
