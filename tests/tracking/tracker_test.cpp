// SPDX-License-Identifier: MIT
// The tracker: what it does with frames, good and bad; that it leaves an uncorrected model alone; and that it closes
// the loop, with decant's simulator and with somebody else's.

#include <cmath>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include <decant/boundary/shapes.hpp>
#include <decant/correction/open_loop.hpp>
#include <decant/correction/transport_corrector.hpp>
#include <decant/simulation/simulator.hpp>
#include <decant/tracking/tracker.hpp>

#include "catch.hpp"
#include "correction/seen.hpp"
#include "tracking/falling_dust.hpp"

using namespace decant;
using decant_test::FallingDust;
using decant_test::seen;

namespace {

static_assert(LiquidModel<FallingDust>);
static_assert(LiquidModel<LiquidSimulator>);

}  // namespace

TEST_CASE("tracker: frames that are late, far ahead, or wrong are answered by a status and change nothing") {
  Tracker<FallingDust, OpenLoop<double>> tracker(FallingDust{});
  tracker.add_camera(decant_test::seeing_camera(), decant_test::before_the_block());
  const Mask mask = seen(tracker.model().dust);
  const std::vector<CameraMask> masks{{0, mask}};
  CHECK(tracker.track({0, {}, masks}).status == FrameStatus::Ok);
  CHECK(tracker.track({0.1, {}, masks}).status == FrameStatus::Ok);
  const auto require_refused = [&](const TrackerFrame& frame, FrameStatus status) {
    const auto before = tracker.model().dust;
    const FrameReport report = tracker.track(frame);
    INFO(to_string(report.status));
    REQUIRE(report.status == status);
    REQUIRE_FALSE(report.advanced());
    REQUIRE(report.time == tracker.model().now);
    REQUIRE(tracker.model().now == 0.1);
    REQUIRE(tracker.model().dust.position == before.position);
  };
  require_refused({0.05, {}, masks}, FrameStatus::Late);
  require_refused({0.1, {}, masks}, FrameStatus::Late);
  require_refused({2, {}, masks}, FrameStatus::Gap);
  require_refused({std::numeric_limits<double>::quiet_NaN(), {}, masks}, FrameStatus::Gap);
  const Mask other = Mask::Zero(10, 10);
  const std::vector<CameraMask> wrong_size{{0, other}}, no_camera{{3, mask}};
  require_refused({0.2, {}, wrong_size}, FrameStatus::BadInput);
  require_refused({0.2, {}, no_camera}, FrameStatus::BadInput);
  Pose lost;
  lost.translation.x() = std::numeric_limits<double>::infinity();
  const std::vector<TrackedPose> no_pose{{0, lost}}, no_body{{7, Pose{}}};
  require_refused({0.2, no_pose, masks}, FrameStatus::BadInput);
  require_refused({0.2, no_body, masks}, FrameStatus::BadInput);
  tracker.model().broken = true;
  require_refused({0.2, {}, masks}, FrameStatus::ModelFailed);
  tracker.model().broken = false;
  // a dropped frame: time goes on
  const FrameReport dropped = tracker.track({0.2, {}, {}});
  CHECK(dropped.status == FrameStatus::Uncorrected);
  CHECK(dropped.advanced());
  CHECK(std::isnan(dropped.prior.iou()));
  CHECK(tracker.model().now == Approx(0.2));
}

TEST_CASE("tracker: takes bodies to their poses and sees what they hide") {
  Tracker<FallingDust, OpenLoop<double>> tracker(FallingDust{});
  tracker.model().gravity = 0;
  tracker.add_camera(decant_test::seeing_camera(), decant_test::before_the_block());
  const Mask mask = seen(tracker.model().dust);
  const std::vector<CameraMask> masks{{0, mask}};
  CHECK(tracker.track({0, {}, masks}).prior.iou() > 0.95);  // cleaning takes corners off
  // the plate, turned up, between the camera and all of the block
  const Pose before_it{Eigen::Quaterniond(Eigen::AngleAxisd(0.5 * 3.14159265358979, Eigen::Vector3d::UnitX())),
                       {0, -0.3, 0}};
  const std::vector<TrackedPose> poses{{0, before_it}};
  const FrameReport report = tracker.track({0.1, poses, masks});
  CHECK(report.status == FrameStatus::Ok);
  CHECK(report.prior.predicted_px == 0);
  CHECK(report.prior.observed_px > 1000);
}

TEST_CASE("tracker: a camera that moves sees from where it is") {
  Tracker<FallingDust, OpenLoop<double>> tracker(FallingDust{});
  tracker.model().gravity = 0;
  tracker.add_camera(decant_test::seeing_camera(), decant_test::before_the_block());
  const Mask mask = seen(tracker.model().dust);
  const std::vector<CameraMask> masks{{0, mask}};
  CHECK(tracker.track({0, {}, masks}).prior.iou() > 0.95);
  // 4 cm to the right, the width of the block: 40 px at half a metre
  Pose aside = decant_test::before_the_block();
  aside.translation.x() -= 0.04;
  const std::vector<CameraPose> cameras{{0, aside}};
  CHECK(tracker.track({0.1, {}, masks, cameras}).prior.iou() < 0.1);
  CHECK(tracker.track({0.2, {}, masks}).prior.iou() < 0.1);  // and stays there
  const std::vector<CameraPose> no_camera{{1, aside}}, lost{{0, {Eigen::Quaterniond(0, 0, 0, 0), {0, 0, 0}}}};
  CHECK(tracker.track({0.3, {}, masks, no_camera}).status == FrameStatus::BadInput);
  CHECK(tracker.track({0.3, {}, masks, lost}).status == FrameStatus::BadInput);
  CHECK(tracker.track({0.3, {}, masks}).status == FrameStatus::Ok);
}

TEST_CASE("tracker: a forecast is seen from where the camera will be") {
  Tracker<FallingDust, OpenLoop<double>> moving(FallingDust{}), beside(FallingDust{});
  moving.add_camera(decant_test::seeing_camera(), decant_test::before_the_block());
  beside.add_camera(decant_test::seeing_camera(), decant_test::beside_the_block());
  FallingDust future = moving.model();
  future.dust.position.row(0).array() += 0.02;  // seen by the one camera, but hardly by the other
  Mask now, then, after, wanted;
  moving.predict(future, 0, now);
  moving.predict(future, 0, decant_test::beside_the_block(), then);
  moving.predict(future, 0, after);
  beside.predict(future, 0, wanted);
  REQUIRE((wanted == mask_liquid).any());
  CHECK((then == wanted).all());
  CHECK_FALSE((now == wanted).all());
  CHECK((after == now).all());
  CHECK_THROWS_WITH(moving.predict(future, 1, Pose{}, then),
                    decant_test::contains("camera must be one that was added"));
}

TEST_CASE("tracker: gaps between particles are closed from near and far, those between films are not") {
  // two films, three spacings apart
  FallingDust film;
  film.gravity = 0;
  const double apart = film.spacing();
  film.dust.resize(128);
  for (Index i = 0; i < film.dust.size(); ++i) {
    const double side = i < 64 ? -8.5 : 1.5;
    film.dust.position.col(i) =
        Vector3<double>(static_cast<double>(i % 8) + side, 0, static_cast<double>(i % 64 / 8) - 3.5) * apart;
  }
  TrackerSettings settings;
  settings.sphere_in_spacings = 0.4;  // does not reach the next particle
  for (const double distance : {0.25, 0.5, 1.0}) {
    CAPTURE(distance);
    Pose camera_from_world = decant_test::before_the_block();
    camera_from_world.translation.z() = distance;
    Tracker<FallingDust, OpenLoop<double>> tracker(film, {}, settings);
    tracker.add_camera(decant_test::seeing_camera(), camera_from_world);
    REQUIRE(tracker.track({0, {}, {}}).advanced());
    const Mask& mask = tracker.predicted(0);
    const auto liquid = [&](double x, double z) {
      const double scale = 500 / distance;
      return mask(std::lround(79.5 - scale * z * apart), std::lround(99.5 + scale * x * apart)) != 0;
    };
    for (int z = -3; z <= 3; ++z) {
      for (int x = 0; x < 7; ++x) {  // midway between four particles
        REQUIRE(liquid(x - 8, z));
        REQUIRE(liquid(x + 2, z));
      }
      REQUIRE_FALSE(liquid(0, z));
    }
  }
}

TEST_CASE("tracker: without correction the model runs as it does alone, bit for bit") {
  SimulatorSettings settings;
  settings.spacing = decant_test::block_spacing;
  settings.threads = {1};
  LiquidSimulator alone(settings);
  const auto drop = decant_test::liquid_block<float>({0, 0, 0});
  alone.add_body("table", Box{{-0.1, -0.1, -0.05}, {0.1, 0.1, -0.03}});
  alone.add_particles(drop.position, drop.velocity, 0);
  Tracker<LiquidSimulator, OpenLoop<>> tracker(alone);
  tracker.add_camera(decant_test::seeing_camera(), decant_test::before_the_block());
  const Mask mask = seen(drop);
  const std::vector<CameraMask> masks{{0, mask}};
  for (int frame = 1; frame <= 4; ++frame) {
    REQUIRE(alone.step(frame / 30.0 - alone.time()).advanced());
    REQUIRE(tracker.track({frame / 30.0, {}, masks}).advanced());
    REQUIRE(tracker.model().fluid().position == alone.fluid().position);
  }
}

TEST_CASE("tracker: a drop that really falls more slowly is followed, and its speed found") {
  // reality falls with 4 m/s^2, the model with 9.81: after 0.2 s they are 12 cm apart
  const double end = 0.2, real = 4;
  const auto follow = [&](auto corrector, Threads threads) {
    SimulatorSettings settings;
    settings.spacing = decant_test::block_spacing;
    settings.threads = {1};
    LiquidSimulator model(settings);
    const auto drop = decant_test::liquid_block<float>({0, 0, 0.05});
    model.add_particles(drop.position, drop.velocity, 0);
    TrackerSettings tracking;
    tracking.threads = threads;
    Tracker<LiquidSimulator, decltype(corrector)> tracker(model, corrector, tracking);
    tracker.add_camera(decant_test::seeing_camera(), decant_test::before_the_block());
    FrameReport report;
    for (int frame = 1; frame <= 6; ++frame) {
      const double t = frame * end / 6;
      const Mask mask = seen(decant_test::liquid_block<float>({0, 0, 0.05 - 0.5 * real * t * t}));
      const std::vector<CameraMask> masks{{0, mask}};
      report = tracker.track({t, {}, masks});
      REQUIRE(report.status == FrameStatus::Ok);
      REQUIRE(decant::overlap(tracker.predicted_before(0), tracker.observed(0)).both_px == report.prior.both_px);
      REQUIRE(decant::overlap(tracker.predicted(0), tracker.observed(0)).both_px == report.posterior.both_px);
    }
    return std::pair{report, tracker.model()};
  };
  const auto [open, alone] = follow(OpenLoop<>(), {1});
  const auto [closed, corrected] = follow(TransportCorrector<>(), {1});
  INFO("open loop " << open.posterior.iou() << ", prior " << closed.prior.iou() << ", closed "
                    << closed.posterior.iou());
  CHECK(open.posterior.iou() < 0.05);
  CHECK(closed.posterior.iou() > 0.85);
  CHECK(closed.prior.iou() > open.prior.iou() + 0.3);
  CHECK(closed.log_likelihood > open.log_likelihood);
  CHECK(closed.correction.moved > 100);
  CHECK(closed.relocated_volume == 0);
  const double height = static_cast<double>(corrected.fluid().position.row(2).mean());
  CHECK(height == Approx(0.05 - 0.5 * real * end * end).margin(0.006));
  CHECK(corrected.fluid().size() == alone.fluid().size());

  const auto [again, with_four] = follow(TransportCorrector<>(), {4});
  CHECK(again.posterior.both_px == closed.posterior.both_px);
  CHECK(with_four.fluid().position == corrected.fluid().position);
}

TEST_CASE("tracker: stops a foreign model's particles at walls") {
  FallingDust dust;
  dust.gravity = 0;
  dust.scene[0].surface =
      std::make_shared<const BoundingVolumeHierarchy>(Box{{0.021, -0.1, -0.1}, {0.022, 0.1, 0.1}}.mesh());
  Tracker<FallingDust, TransportCorrector<double>> tracker(dust);
  tracker.add_camera(decant_test::seeing_camera(), decant_test::before_the_block());
  const Mask mask = seen(decant_test::liquid_block<double>({0.015, 0, 0}));
  const std::vector<CameraMask> masks{{0, mask}};
  for (int frame = 1; frame <= 3; ++frame) {
    REQUIRE(tracker.track({frame / 30.0, {}, masks}).advanced());
    tracker.model().dust.velocity.setZero();
  }
  CHECK(tracker.model().dust.position.row(0).mean() > 0.002);
  CHECK(tracker.model().dust.position.row(0).maxCoeff() < 0.021);
}

TEST_CASE("tracker: settings are checked") {
  TrackerSettings settings;
  settings.sphere_in_spacings = std::nan("");
  using Plain = Tracker<FallingDust, OpenLoop<double>>;
  CHECK_THROWS_WITH(Plain(FallingDust{}, {}, settings), decant_test::contains("sphere_in_spacings must be > 0"));
  settings = {};
  settings.longest_gap = 0;
  CHECK_THROWS_WITH(Plain(FallingDust{}, {}, settings), decant_test::contains("longest_gap [s] must be > 0"));
}
