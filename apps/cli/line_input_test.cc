// SPDX-License-Identifier: Apache-2.0
#include "line_input.h"

#include <sstream>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "helicarm/core/failure.h"
#include "terminal_test.h"
#include "touch_points.h"

namespace helicarm::cli {
namespace {

constexpr int at_once = 0, patient = 10000;

/// Writes into the input under test.
struct Pipe {
  int ends[2];
  Pipe() { EXPECT_EQ(::pipe(ends), 0); }
  ~Pipe() {
    ::close(ends[0]);
    end();
  }
  void write(const std::string& text) {
    EXPECT_EQ(::write(ends[1], text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }
  void end() {
    if (ends[1] >= 0) ::close(std::exchange(ends[1], -1));
  }
};

Reason reason_of_next(LineInput& input) {
  const auto line = guarded([&] { return input.next(at_once); });
  return line ? Reason::usage : line.error().reason;
}

TEST(LineInput, LinesOfOneWriteAreReadOneByOne) {
  Pipe pipe;
  LineInput input(pipe.ends[0]);
  pipe.write("shoot AP\nwhere\nqu");
  EXPECT_EQ(input.next(at_once), "shoot AP");
  EXPECT_EQ(input.next(at_once), "where");
  EXPECT_EQ(input.next(at_once), std::nullopt);
  pipe.write("it\n");
  EXPECT_EQ(input.next(at_once), "quit");
}

TEST(LineInput, LastLineNeedsNoEnd) {
  Pipe pipe;
  LineInput input(pipe.ends[0]);
  pipe.write("\nquit");
  pipe.end();
  EXPECT_EQ(input.next(at_once), "");
  EXPECT_EQ(input.next(at_once), "quit");
  EXPECT_EQ(reason_of_next(input), Reason::interrupted);
  EXPECT_EQ(reason_of_next(input), Reason::interrupted);
}

TEST(LineInput, LineOf1000BytesIsReadAndALongerOneRefused) {
  Pipe pipe;
  LineInput input(pipe.ends[0]);
  pipe.write(std::string(LineInput::longest, 'x') + "\n");
  EXPECT_EQ(input.next(at_once).value().size(), LineInput::longest);
  pipe.write(std::string(LineInput::longest + 1, 'x') + "\n");
  EXPECT_EQ(reason_of_next(input), Reason::bad_size);
}

TEST(LineInput, WhatWasTypedAtATerminalBeforeAQuestionIsNoAnswer) {
  const Terminal terminal;
  LineInput input(terminal.slave);
  terminal.type("one\ntwo\nthr");
  EXPECT_EQ(input.next(patient), "one");
  input.discard();
  EXPECT_EQ(input.next(at_once), std::nullopt);
  terminal.type("answer\n");
  EXPECT_EQ(input.next(patient), "answer");
}

TEST(LineInput, LinesOfAPipeWaitForTheirQuestions) {
  Pipe pipe;
  LineInput input(pipe.ends[0]);
  pipe.write("one\ntwo\n");
  EXPECT_EQ(input.next(at_once), "one");
  input.discard();
  EXPECT_EQ(input.next(at_once), "two");
}

TEST(AskToTouch, AnEarlierEnterIsNoAnswer) {
  const Terminal terminal;
  LineInput input(terminal.slave);
  terminal.type("\n");
  std::ostringstream out, progress;
  Console console{out, progress};
  ask_to_touch("femur notch", input, console);
  EXPECT_EQ(input.next(at_once), std::nullopt);
  EXPECT_NE(progress.str().find("touch \"femur notch\""), std::string::npos);
}

TEST(LineInput, InputWithoutLineEndsIsBounded) {
  const int zeros = ::open("/dev/zero", O_RDONLY | O_CLOEXEC);
  LineInput input(zeros);
  EXPECT_EQ(reason_of_next(input), Reason::bad_size);
  ::close(zeros);
}

}  // namespace
}  // namespace helicarm::cli
