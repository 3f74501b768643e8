// SPDX-License-Identifier: MIT

#include <cmath>
#include <memory>
#include <vector>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/boundary/shapes.hpp>
#include <decant/camera/pinhole_camera.hpp>
#include <decant/hypothesis/independent_groups.hpp>

#include "catch.hpp"

using namespace decant;

namespace {

struct PlacedBody {
  std::shared_ptr<const BoundingVolumeHierarchy> surface;
  PoseTrack motion;
};

PoseTrack standing_at(double x, double z) { return PoseTrack(Pose{Eigen::Quaterniond::Identity(), {x, 0, z}}); }

PlacedBody cup_at(double x) {
  return {std::make_shared<const BoundingVolumeHierarchy>(Cup{0.03, 0.04, 0.09, 0.003}.mesh()), standing_at(x, 0.15)};
}
PlacedBody pan_at(double x) {
  return {std::make_shared<const BoundingVolumeHierarchy>(CylinderInside{0.13, 0.045, 0.003, Face::PositiveZ}.mesh()),
          standing_at(x, 0)};
}

/// A cup over a pan, and another pair so far to the right.
std::vector<PlacedBody> two_pairs(double apart) { return {cup_at(0), pan_at(0), cup_at(apart), pan_at(apart)}; }

}  // namespace

TEST_CASE("independent groups: cups far apart share nothing, cups side by side may") {
  const std::vector<BodyId> sources{0, 2};
  const auto far = independent_groups(two_pairs(2), sources, {});
  REQUIRE(far.size() == 2);
  CHECK(far[0].bodies == std::vector<BodyId>{0, 1});
  CHECK(far[1].bodies == std::vector<BodyId>{2, 3});

  const auto near = independent_groups(two_pairs(0.5), sources, {});
  REQUIRE(near.size() == 1);
  CHECK(near[0].bodies == std::vector<BodyId>{0, 1, 2, 3});
}

TEST_CASE("independent groups: reach is that of the farthest jet") {
  // column c: v^2 = 2 g c; falls by h: it lands v / g sqrt(v^2 + 2 g h) = 2 sqrt(c (c + h)) away
  const std::vector<PlacedBody> bodies{cup_at(0), pan_at(0)};
  const auto groups = independent_groups(bodies, std::vector<BodyId>{0}, {});
  REQUIRE(groups.size() == 1);
  const Eigen::AlignedBox3d cup = bodies[0].surface->bounds();
  const double column = cup.diagonal().norm(), drop = 0.15 + cup.max().z() - bodies[1].surface->bounds().min().z();
  CHECK(groups[0].reach.max().x() ==
        Approx(cup.max().x() + 2 * std::sqrt(column * (column + drop)) + IndependentGroupsSettings{}.margin));
}

TEST_CASE("independent groups: a cup that travels reaches what it passes") {
  auto bodies = two_pairs(2);
  bodies[0].motion = PoseTrack({{0, Pose{Eigen::Quaterniond::Identity(), {0, 0, 0.15}}},
                                {4, Pose{Eigen::Quaterniond::Identity(), {1.5, 0, 0.15}}}});
  const std::vector<BodyId> sources{0, 2};
  IndependentGroupsSettings settings;
  settings.end = 0.1;
  CHECK(independent_groups(bodies, sources, settings).size() == 2);
  settings.end = 4;
  CHECK(independent_groups(bodies, sources, settings).size() == 1);
}

TEST_CASE("independent groups: up is where gravity says") {
  // a cup 1 m above another: apart if gravity is sideways, and one above the other if it is not
  std::vector<PlacedBody> bodies{cup_at(0), cup_at(0)};
  bodies[1].motion = standing_at(0, 1.5);
  const std::vector<BodyId> sources{0, 1};
  CHECK(independent_groups(bodies, sources, {}).size() == 1);
  IndependentGroupsSettings sideways;
  sideways.gravity = {9.81, 0, 0};
  CHECK(independent_groups(bodies, sources, sideways).size() == 2);
}

TEST_CASE("independent groups: bodies that nothing reaches are in no group") {
  auto bodies = two_pairs(2);
  const auto groups = independent_groups(bodies, std::vector<BodyId>{2}, {});
  REQUIRE(groups.size() == 1);
  CHECK(groups[0].bodies == std::vector<BodyId>{2, 3});
  CHECK(independent_groups(bodies, std::vector<BodyId>{}, {}).empty());
}

TEST_CASE("independent groups: pixels are those where the reach is seen") {
  const auto groups = independent_groups(two_pairs(3), std::vector<BodyId>{0, 2}, {});
  REQUIRE(groups.size() == 2);
  // 4 m in front of the cups, between them, looking along y
  Pose camera_from_world;
  camera_from_world.rotation = Eigen::Quaterniond::FromTwoVectors(Vector3<double>::UnitY(), Vector3<double>::UnitZ());
  camera_from_world.translation = -(camera_from_world.rotation * Vector3<double>(1.5, -4, 0.1));
  const PosedCamera<PinholeCamera> camera(PinholeCamera(500, 500, 319.5, 239.5, 640, 480), camera_from_world);
  const PixelBox left = pixels_of(groups[0], camera), right = pixels_of(groups[1], camera);
  CHECK(!left.empty());
  CHECK(!right.empty());
  CHECK(left.intersection(right).empty());
  // every corner of the reach falls into it
  const auto pixel = camera.project(Vector3<double>(0.1, 0.1, 0.1)).pixel;
  CHECK(left.contains(static_cast<int>(pixel.x()), static_cast<int>(pixel.y())));
  // from within, all of the picture
  const PosedCamera<PinholeCamera> within(PinholeCamera(500, 500, 319.5, 239.5, 640, 480));
  CHECK(pixels_of(groups[0], within) == PixelBox{0, 0, 640, 480});
}

TEST_CASE("independent groups: what makes no sense is refused") {
  const auto bodies = two_pairs(2);
  CHECK_THROWS_WITH(independent_groups(bodies, std::vector<BodyId>{7}, {}), Catch::Contains("source"));
  IndependentGroupsSettings weightless;
  weightless.gravity.setZero();
  CHECK_THROWS_WITH(independent_groups(bodies, std::vector<BodyId>{0}, weightless), Catch::Contains("gravity"));
  IndependentGroupsSettings backward;
  backward.end = -1;
  CHECK_THROWS_WITH(independent_groups(bodies, std::vector<BodyId>{0}, backward), Catch::Contains("end [s]"));
}
