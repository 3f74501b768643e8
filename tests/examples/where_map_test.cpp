// SPDX-License-Identifier: MIT
// Where recordings disagree with a model, as a picture, a table and JSON.

#include "../../examples/support/where_map.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <decant/core/image.hpp>
#include <decant/discovery/disagreement.hpp>
#include <decant/discovery/missing_effect.hpp>

#include "../../examples/support/missing_effect_output.hpp"
#include "catch.hpp"

using namespace decant;

namespace {

/// Too much in two squares, twice as much in the second one, which reaches beyond the border.
Disagreement too_much() {
  Disagreement one;
  one.begin = 0.5;
  one.end = 0.7;
  one.onset_u = 29.5;
  one.onset_v = 29.5;
  one.weight = 125;
  one.squares = {{{20, 20, 40, 40}, 0.5, 0.6, 5}, {{80, 20, 120, 40}, 0.6, 0.7, 10}};
  return one;
}

/// Too little, by less, in one of its squares, and elsewhere.
Disagreement too_little() {
  Disagreement one;
  one.unexpected = false;
  one.begin = 0.2;
  one.weight = 32;
  one.squares = {{{20, 20, 40, 40}, 0.2, 0.3, 4}, {{20, 60, 40, 80}, 0.2, 0.3, 4}};
  return one;
}

}  // namespace

TEST_CASE("where map: squares add up over time, the larger of too much and too little is drawn") {
  Disagreement of_another_camera = too_much();
  of_another_camera.camera = 1;
  const example::detail::WhereMap map =
      example::detail::where_map({of_another_camera, too_much(), too_little()}, 100, 90);
  CHECK(map.begin == 0.5);
  CHECK(map.onset == Eigen::Vector2d(29.5, 29.5));
  CHECK(map.off.rows() == 90);
  CHECK(map.off(30, 30) == Approx(5));
  CHECK(map.off(39, 99) == Approx(10));
  CHECK(map.off(60, 39) == Approx(-4));
  CHECK(map.off(60, 40) == 0);
  CHECK((map.off != 0).count() == 3 * 400);

  Image<std::uint8_t> bodies = Image<std::uint8_t>::Constant(90, 100, example::detail::body);
  bodies(30, 90) = example::detail::body_edge;
  const PalettePicture picture = example::detail::where_picture(bodies, map);
  const auto colour = [&](Index v, Index u) { return picture.colours.at(picture.index(v, u)); };
  CHECK(colour(35, 90) == example::detail::overlay_colours()[example::detail::observed_only]);  // as strong as any
  CHECK(colour(30, 90) == example::detail::overlay_colours()[example::detail::body_edge]);
  CHECK(colour(29, 38) == example::detail::overlay_colours()[example::detail::both]);  // the ring
  CHECK(colour(80, 80) == example::detail::overlay_colours()[example::detail::body]);
  const auto too_much_colour = colour(29, 29), too_little_colour = colour(70, 30);
  CHECK(too_much_colour[0] > too_much_colour[2]);  // amber
  CHECK(too_little_colour[0] < too_little_colour[2]);
  CHECK(!example::detail::where_map({}, 100, 90).begin);
}

TEST_CASE("where map: the table and the JSON name the body that is near") {
  MissingEffect result;
  result.where = {{too_much(), too_little()}};
  const example::NamedPlaces places{{example::NamedPlace{{{0.1, -0.02, 0.3}, 1, 0.0042}, "pan"}, std::nullopt}};
  const nlohmann::json json = example::where_json({"a"}, result, places);
  REQUIRE(json.size() == 2);
  CHECK(json[0]["near"] == "pan");
  CHECK(json[0]["place"] == nlohmann::json({0.1, -0.02, 0.3}));
  CHECK(json[0]["distance_m"] == 0.0042);
  CHECK(json[0]["liquid"] == "unexpected");
  CHECK(json[1]["liquid"] == "missing");
  CHECK(!json[1].contains("near"));
  const std::string table = example::where_table({"a"}, result, places).text();
  CHECK(table.find("100, -20, 300") != std::string::npos);
  CHECK(table.find("4 mm from the pan") != std::string::npos);
  // as where no places were asked for
  CHECK(example::where_json({"a"}, result, {}).size() == 2);
  CHECK(example::detail::first_onset(result.where)->begin == 0.2);

  result.judgement.chance.largest_distance = 3;
  result.judgement.distance = 10;
  CHECK(!example::is_diffuse(result));
  result.where = {{}};
  CHECK(example::is_diffuse(result));
  CHECK(!example::detail::first_onset(result.where));
  result.judgement.distance = 2;  // no gap
  CHECK(!example::is_diffuse(result));
}
