// SPDX-License-Identifier: MIT
// Progress: silent where nobody looks, one line where somebody does.

#include <decant/io/progress.hpp>

#include <cstdio>
#include <string>

#include "catch.hpp"

namespace {

std::string written(std::FILE* stream) {
  std::rewind(stream);
  std::string text;
  for (int c = std::fgetc(stream); c != EOF; c = std::fgetc(stream)) {
    text += static_cast<char>(c);
  }
  return text;
}

}  // namespace

TEST_CASE("progress: nothing is written to a file") {
  std::FILE* file = std::tmpfile();
  REQUIRE(file != nullptr);
  {
    decant::Progress progress("run", 10, file);
    progress.update(5);
  }
  CHECK(written(file).empty());
  std::fclose(file);
}

TEST_CASE("progress: one line that is cleared at the end") {
  std::FILE* file = std::tmpfile();
  REQUIRE(file != nullptr);
  {
    decant::Progress progress("run", 10, file, true);
    progress.update(2.5, "note");
    progress.update(5);  // within a tenth of a second: not shown
  }
  const std::string text = written(file);
  CHECK(text.find("\rrun 25 %, 0:0") == 0);
  CHECK(text.find("left, note") != std::string::npos);
  CHECK(text.find("50 %") == std::string::npos);
  CHECK(text.find('\n') == std::string::npos);
  CHECK(text.back() == '\r');
  std::fclose(file);
}
