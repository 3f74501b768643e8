// SPDX-License-Identifier: MIT
// Tables and progress on the terminal.

#include <decant/io/table.hpp>

#include "catch.hpp"

TEST_CASE("table: columns are aligned also with letters of several bytes") {
  decant::Table table({"name", "value [mm]"});
  table.add({"peak µ", "12.5"});
  table.add({"x"});
  table.add({"y", "1", "dropped"});
  CHECK(table.text() ==
        "name    value [mm]\n"
        "------------------\n"
        "peak µ        12.5\n"
        "x\n"
        "y                1\n");
}
