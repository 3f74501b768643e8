// SPDX-License-Identifier: MIT
// Motions from CSV: both forms, and the message of each bad one.

#include <decant/io/motion_file.hpp>

#include <string>
#include <vector>

#include "catch.hpp"
#include "temporary_folder.hpp"

TEST_CASE("motion file: with header and commas and w first") {
  const auto track = decant::parse_motion(
      "t_s,x_m,y_m,z_m,qw,qx,qy,qz\r\n0, 0,0,0, 1,0,0,0\r\n\n# turned by 90 degrees about z\n"
      "2,1,2,3,0.70710678118654757,0,0,0.70710678118654757\n",
      "m.csv");
  REQUIRE(track.samples().size() == 2);
  CHECK(track.end_time() == 2);
  CHECK((track.at(2) * decant::Vector3<double>(1, 0, 0) - decant::Vector3<double>(1, 3, 3)).norm() < 1e-12);
  CHECK(track.at(1).translation == decant::Vector3<double>(0.5, 1, 1.5));
}

TEST_CASE("motion file: without header and semicolons and w last") {
  const decant_test::TemporaryFolder folder("motion");
  const auto path = folder.write("m.csv", "0;0;0;0;0;0;0;1\n0.002;1;2;3;0;0;0.70710678118654757;0.70710678118654757\n");
  const auto track = decant::read_motion(path);
  REQUIRE(track.samples().size() == 2);
  CHECK(track.end_time() == 0.002);
  CHECK((track.at(1) * decant::Vector3<double>(1, 0, 0) - decant::Vector3<double>(1, 3, 3)).norm() < 1e-12);
}

TEST_CASE("motion file: bad ones are refused with the line") {
  struct Case {
    const char* text;
    const char* message;
  };
  const std::string header = "t_s,x_m,y_m,z_m,qw,qx,qy,qz\n";
  const std::vector<Case> cases = {
      {"", "m.csv: must hold at least one pose"},
      {"hello", "line 1 must be the header t_s,x_m,y_m,z_m,qw,qx,qy,qz or a row"},
      {"0;0;0;0;0;0;1", "line 1 must be 8 cells, got 7"},
      {"0;0;0;0;0;0;0;1\n0;0;0;0;0;0;0;1", "line 2, time [s] must be later than the row before"},
      {"0;0;nan;0;0;0;0;1", "line 1, cell 3 must be a finite number of at most 1e9, got \"nan\""},
      {"0;0;1e300;0;0;0;0;1", "line 1, cell 3 must be"},
      {"0;0;1 2;0;0;0;0;1", "line 1, cell 3 must be"},
      {"0;0;;0;0;0;0;1", "line 1, cell 3 must be"},
      {"0;0;0;0;0;0;0;1.01", "norm of the quaternion must be within 1e-3 of 1, got 1.01"},
      {"0;0;0;0;0;0;0;0", "norm of the quaternion"},
  };
  for (const Case& c : cases) {
    const std::string message = decant_test::message_of([&] { decant::parse_motion(c.text, "m.csv"); });
    INFO(c.text << "\ngot " << message);
    CHECK(message.find(c.message) != std::string::npos);
  }
  CHECK(decant_test::message_of([&] { decant::parse_motion(header + "0,0,0,0,1,0,0\n", "m"); }) ==
        "m: line 2 must be 8 cells, got 7");
  CHECK(decant_test::message_of([&] { decant::parse_motion(header, "m"); }) == "m: must hold at least one pose");
}
