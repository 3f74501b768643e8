// SPDX-License-Identifier: MIT
// Time series in CSV: names with commas, missing values, a round trip to the same bits, the messages.

#include <decant/io/series_file.hpp>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "catch.hpp"
#include "temporary_folder.hpp"

TEST_CASE("series file: columns and missing values and names with places in them") {
  const auto series = decant::parse_series(
      "t_s,level_mm@2.66,0.5,\"pressure_pa@0.9,0.5,-2e-2\",front_mm\n0,1,2,3\n0.5,,-2.5e1,\n", "s.csv");
  CHECK(series.names == std::vector<std::string>{"t_s", "level_mm@2.66,0.5", "pressure_pa@0.9,0.5,-2e-2", "front_mm"});
  REQUIRE(series.rows() == 2);
  CHECK(series.columns[2][1] == -25);
  CHECK(std::isnan(series.columns[1][1]));
  CHECK(std::isnan(series.columns[3][1]));
  REQUIRE(series.find("front_mm") != nullptr);
  CHECK(series.find("front_mm")->at(0) == 3);
  CHECK(series.find("front") == nullptr);
}

TEST_CASE("series file: what is written is read back to the same bits") {
  const decant_test::TemporaryFolder folder("series");
  const decant::Series series{{"t_s", "a\"b,1", "c"},
                              {{0, 0.1, 1.0 / 3}, {1e-300, -1e300, 5}, {0, std::nan(""), 0.1 + 0.2}}};
  decant::write_series(folder.path() / "s.csv", series);
  const auto back = decant::read_series(folder.path() / "s.csv");
  CHECK(back.names == series.names);
  CHECK(back.columns[0] == series.columns[0]);
  CHECK(back.columns[1] == series.columns[1]);
  CHECK(std::isnan(back.columns[2][1]));
  CHECK(back.columns[2][2] == series.columns[2][2]);
}

TEST_CASE("series file: bad ones are refused with line and column") {
  const auto message = [](const char* text) {
    return decant_test::message_of([&] { decant::parse_series(text, "s.csv"); });
  };
  CHECK(message("") == "s.csv: must start with a header, got an empty file");
  CHECK(message("time,a\n") == "s.csv: line 1, first column must be t_s, got \"time\"");
  CHECK(message("t_s,a,a\n").find("line 1, column 3 must be a name that no other column has") != std::string::npos);
  CHECK(message("t_s,,a\n").find("line 1, column 2 must be a name") != std::string::npos);
  CHECK(message("t_s,a\n1\n") == "s.csv: line 2 must be 2 cells, got 1");
  CHECK(message("t_s,a\n1,x\n") == "s.csv: line 2, \"a\" must be a finite number or empty, got \"x\"");
  CHECK(message("t_s,a\n1,inf\n").find("\"a\" must be a finite number or empty") != std::string::npos);
  CHECK(message("t_s,a\n,1\n") == "s.csv: line 2, \"t_s\" must be a finite number, got \"\"");
  CHECK(message("t_s,a\n1,1\n1,2\n") == "s.csv: line 3, t_s must be later than the row before, got 1");
  CHECK(message("t_s,\"a\n").find("closed by a quote") != std::string::npos);
  CHECK(message("t_s,\"a\"b\n").find("a comma after a quoted cell") != std::string::npos);
}
