// SPDX-License-Identifier: MIT

#include <cmath>
#include <utility>
#include <vector>

#include <decant/correction/open_loop.hpp>
#include <decant/correction/transport_corrector.hpp>
#include <decant/tracking/fixed_lag_tracker.hpp>

#include "catch.hpp"
#include "tracking/falling_dust.hpp"

using namespace decant;
using decant_test::CarriedDust;
using decant_test::FallingDust;

namespace {

/// Starts high in the picture, which it then does not leave in a third of a second.
FallingDust high_dust() {
  FallingDust model;
  model.dust.position.row(2).array() += 0.05;
  return model;
}

template <class CorrectorType>
Tracker<FallingDust, CorrectorType> dust_tracker() {
  Tracker<FallingDust, CorrectorType> tracker(high_dust());
  tracker.add_camera(decant_test::seeing_camera(), decant_test::before_the_block());
  return tracker;
}

using DustParameter = UncertainParameter<FallingDust>;

/// The model believes in 1 m/s^2.
const DustParameter more_gravity{"gravity [m/s^2]", 1,
                                 [](FallingDust& model, double more) { model.gravity = -1 - more; }};

/// Follows dust that falls with 2 m/s^2, for so many frames.
template <class Follower>
void follow_fall(int frames, Follower& follower) {
  FallingDust reality = high_dust();
  reality.gravity = -2;
  for (int frame = 1; frame <= frames; ++frame) {
    reality.step(1 / 30.0);
    const Mask mask = decant_test::seen(reality.dust);
    const std::vector<CameraMask> masks{{0, mask}};
    REQUIRE(follower.track({frame / 30.0, {}, masks}).advanced());
  }
}
template <class CorrectorType>
FixedLagTracker<Tracker<FallingDust, CorrectorType>> follow_fall(int frames, const FixedLagSettings& settings) {
  FixedLagTracker<Tracker<FallingDust, CorrectorType>> follower(dust_tracker<CorrectorType>(), {more_gravity},
                                                                settings);
  follow_fall(frames, follower);
  return follower;
}

FixedLagSettings without_delay() {
  FixedLagSettings settings;
  settings.delay_deviation = 0;
  settings.lag = 10;
  settings.interval = 5;
  settings.cell_px = 8;
  return settings;
}

}  // namespace

TEST_CASE("fixed lag: learns what the model has wrong, with a corrector that hides it and without one") {
  // one lag: what was lost before it was learned, an uncorrected model never makes up for but by learning too much
  auto open = follow_fall<OpenLoop<double>>(5, without_delay());
  CHECK(open.value(0) == Approx(1).margin(0.2));
  // the frames were run through once more, so the dust has fallen as far as it should: 14 mm more than without
  FallingDust reality = high_dust();
  reality.gravity = -1 - open.value(0);
  for (int frame = 1; frame <= 5; ++frame) {
    reality.step(1 / 30.0);
  }
  CHECK((open.tracker().model().dust.position - reality.dust.position).cwiseAbs().maxCoeff() < 1e-9);
  FixedLagSettings patient = without_delay();
  patient.retrack_after = 100;
  const auto position = follow_fall<OpenLoop<double>>(5, patient).tracker().model().dust.position;
  CHECK((position - reality.dust.position).row(2).minCoeff() > 0.008);
  auto corrected = follow_fall<TransportCorrector<double>>(10, without_delay());
  CHECK(corrected.value(0) == Approx(1).margin(0.2));
  CHECK(corrected.tracker().model().gravity == Approx(-1 - corrected.value(0)));
  CHECK(corrected.pose_delay() == 0);
}

TEST_CASE("fixed lag: a scout judges parameters in place of the tracker") {
  const auto tracker = dust_tracker<TransportCorrector<double>>();
  FallingDust low = high_dust();
  low.dust.position.row(2).array() -= 0.01;  // looks as if it had fallen for longer
  Tracker<FallingDust, TransportCorrector<double>> scout(low);
  using Follower = FixedLagTracker<decltype(scout)>;
  CHECK_THROWS_WITH(Follower(tracker, scout, {more_gravity}), decant_test::contains("cameras of the scout must be 1"));
  scout.add_camera(decant_test::seeing_camera(), decant_test::before_the_block());
  Follower follower(tracker, scout, {more_gravity}, without_delay());
  follow_fall(10, follower);
  CHECK(follower.value(0) < 0.8);  // by itself it finds 0.8 to 1.2
}

TEST_CASE("fixed lag: learns on when its beginning is out of sight, also if a scout is lost there") {
  const DustParameter weak_gravity{"gravity [m/s^2]", 0.1,
                                   [](FallingDust& model, double more) { model.gravity = -more; }};
  const bool lost = GENERATE(false, true);
  const auto floating_tracker = [](bool broken) {
    FallingDust model = high_dust();
    model.broken = broken;
    Tracker<FallingDust, TransportCorrector<double>> tracker(model);
    tracker.add_camera(decant_test::seeing_camera(), decant_test::before_the_block());
    return tracker;
  };
  FixedLagTracker<Tracker<FallingDust, TransportCorrector<double>>> follower(
      floating_tracker(false), floating_tracker(lost), {weak_gravity}, without_delay());
  FallingDust reality = high_dust();
  reality.gravity = -0.1;
  double at_first = 0;
  for (int frame = 1; frame <= 40; ++frame) {
    reality.step(1 / 30.0);
    const Mask mask = decant_test::seen(reality.dust);
    std::vector<CameraMask> masks{{0, mask}};
    if (frame > 25) {
      masks.clear();
    }
    REQUIRE(follower.track({frame / 30.0, {}, masks}).advanced());
    at_first = frame == 10 ? follower.value(0) : at_first;
    if (frame >= 25) {  // and keeps it when nothing is seen any more
      // when learning begins late, the speed that the tracker lacks is made up for
      CHECK(follower.value(0) == Approx(lost ? 0.15 : 0.1).margin(lost ? 0.1 : 0.02));
    }
  }
  CHECK((at_first == 0) == lost);
}

TEST_CASE("fixed lag: a model that is right is left alone, and is tracked as without adaptation") {
  FixedLagTracker<Tracker<FallingDust, TransportCorrector<double>>> follower(dust_tracker<TransportCorrector<double>>(),
                                                                             {more_gravity}, without_delay());
  auto plain = dust_tracker<TransportCorrector<double>>();
  FallingDust reality = high_dust();
  for (int frame = 1; frame <= 10; ++frame) {
    reality.step(1 / 30.0);
    const Mask mask = decant_test::seen(reality.dust);
    const std::vector<CameraMask> masks{{0, mask}};
    REQUIRE(follower.track({frame / 30.0, {}, masks}).posterior.both_px ==
            plain.track({frame / 30.0, {}, masks}).posterior.both_px);
  }
  CHECK(follower.value(0) == 0);
  CHECK(follower.tracker().model().dust.position == plain.model().dust.position);
}

TEST_CASE("fixed lag: poses that come late or early are found out, and caught up with") {
  // the dust is carried to the right and turned, and its poses are 0.08 s late, or early
  const double delay = GENERATE(0.08, -0.08);
  const auto real_pose = [](double t) {
    return Pose{Eigen::Quaterniond(Eigen::AngleAxisd(0.5 * t, Vector3<double>::UnitY())), {-0.06 + 0.15 * t, 0, 0}};
  };
  CarriedDust start;
  start.scene[0].motion = PoseTrack(real_pose(-delay));
  for (Index i = 0; i < start.dust.size(); ++i) {
    start.dust.position.col(i) = real_pose(-delay) * Vector3<double>(start.dust.position.col(i));
  }
  Tracker<CarriedDust, OpenLoop<double>> tracker(start);
  tracker.add_camera(decant_test::seeing_camera(), decant_test::before_the_block());
  FixedLagSettings settings;
  settings.lag = 10;
  settings.interval = 5;
  settings.cell_px = 8;
  FixedLagTracker<decltype(tracker)> follower(tracker, {}, settings);
  const auto block = decant_test::liquid_block<double>({0, 0, 0});
  double late = 0, caught_up = 0;
  for (int frame = 1; frame <= 20; ++frame) {
    const double t = frame / 30.0;
    FluidState<double> reality = block;
    for (Index i = 0; i < block.size(); ++i) {
      reality.position.col(i) = real_pose(t) * Vector3<double>(block.position.col(i));
    }
    const Mask mask = decant_test::seen(reality);
    const std::vector<CameraMask> masks{{0, mask}};
    const std::vector<TrackedPose> poses{{0, real_pose(t - delay)}};
    const FrameReport report = follower.track({t, poses, masks});
    REQUIRE(report.advanced());
    late = frame == 5 ? report.prior.iou() : late;
    caught_up = report.prior.iou();
  }
  CHECK(follower.pose_delay() == Approx(delay).margin(0.01));
  // what cannot be used is refused, also where poses are moved in time
  Pose nowhere;
  nowhere.translation.x() = std::nan("");
  const std::vector<TrackedPose> lost{{0, nowhere}};
  CHECK(follower.track({0.5, lost, {}}).status == FrameStatus::Late);
  CHECK(follower.track({20 / 30.0, lost, {}}).status == FrameStatus::Late);
  CHECK(follower.track({21 / 30.0, lost, {}}).status == FrameStatus::BadInput);
  CHECK(follower.track({std::nan(""), lost, {}}).status == FrameStatus::Gap);
  CHECK(follower.track({21 / 30.0, {}, {}}).advanced());
  // at first, 12 mm of the block's 40 lag behind or are ahead
  CHECK(late < 0.65);
  CHECK(caught_up > 0.9);
}

TEST_CASE("fixed lag: a camera that moves is where the frame says, also when frames are run through again") {
  FixedLagTracker<Tracker<FallingDust, TransportCorrector<double>>> follower(dust_tracker<TransportCorrector<double>>(),
                                                                             {more_gravity}, without_delay());
  FallingDust reality = high_dust();
  reality.gravity = -2;
  for (int frame = 1; frame <= 10; ++frame) {
    reality.step(1 / 30.0);
    Pose camera_from_world = decant_test::before_the_block();
    camera_from_world.translation.x() = 0.006 * frame;  // 6 px a frame, to the left
    decant_test::Eye<double> eye(camera_from_world);
    eye.observe(reality.dust);
    const std::vector<CameraMask> masks{{0, eye.observed}};
    const std::vector<CameraPose> cameras{{0, camera_from_world}};
    REQUIRE(follower.track({frame / 30.0, {}, masks, cameras}).status == FrameStatus::Ok);
  }
  CHECK(follower.value(0) == Approx(1).margin(0.2));
  const Vector3<double> center = follower.tracker().model().dust.position.rowwise().mean();
  CHECK(std::abs(center.x()) < 0.002);
}

TEST_CASE("fixed lag: frames that are refused are not remembered, and frames without masks teach nothing") {
  FixedLagTracker<Tracker<FallingDust, OpenLoop<double>>> follower(dust_tracker<OpenLoop<double>>(), {more_gravity},
                                                                   without_delay());
  const Mask wrong_size = Mask::Zero(2, 2);
  const std::vector<CameraMask> wrong{{0, wrong_size}};
  for (int frame = 1; frame <= 12; ++frame) {
    CHECK(follower.track({frame / 30.0, {}, wrong}).status == FrameStatus::BadInput);
    CHECK(follower.track({frame / 30.0, {}, {}}).status == FrameStatus::Uncorrected);
    CHECK(follower.track({0, {}, {}}).status == FrameStatus::Late);
  }
  CHECK(follower.value(0) == 0);
  CHECK(follower.tracker().model().now == Approx(0.4));
}

TEST_CASE("fixed lag: the same bits for 1, 2 and 4 threads", "[threads]") {
  FixedLagSettings settings = without_delay();
  settings.threads = {1};
  auto alone = follow_fall<TransportCorrector<double>>(5, settings);
  REQUIRE(alone.value(0) != 0);
  for (const int threads : {2, 4}) {
    settings.threads = {threads};
    auto shared = follow_fall<TransportCorrector<double>>(5, settings);
    CHECK(shared.value(0) == alone.value(0));
    CHECK(shared.tracker().model().dust.position == alone.tracker().model().dust.position);
  }
}

TEST_CASE("fixed lag: settings are checked") {
  using Follower = FixedLagTracker<Tracker<FallingDust, OpenLoop<double>>>;
  const auto tracker = dust_tracker<OpenLoop<double>>();
  FixedLagSettings settings;
  settings.lag = 1;
  CHECK_THROWS_WITH(Follower(tracker, {}, settings), decant_test::contains("lag [frames] must be >= 2"));
  settings = {};
  settings.interval = settings.lag + 1;
  CHECK_THROWS_WITH(Follower(tracker, {}, settings),
                    decant_test::contains("interval [frames] must be >= 1 and <= lag"));
  settings = {};
  settings.retrack_after = -1;
  CHECK_THROWS_WITH(Follower(tracker, {}, settings), decant_test::contains("retrack_after [deviations] must be >= 0"));
  settings = {};
  settings.probe = 0;
  CHECK_THROWS_WITH(Follower(tracker, {}, settings), decant_test::contains("probe must be > 0"));
  CHECK_THROWS_WITH(Follower(tracker, {DustParameter{"nothing", 1, {}}}),
                    decant_test::contains("'nothing' must be one that can be applied"));
}
