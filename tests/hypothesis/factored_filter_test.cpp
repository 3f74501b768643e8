// SPDX-License-Identifier: MIT

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/boundary/shapes.hpp>
#include <decant/camera/pinhole_camera.hpp>
#include <decant/correction/open_loop.hpp>
#include <decant/correction/transport_corrector.hpp>
#include <decant/hypothesis/factored_filter.hpp>
#include <decant/hypothesis/value_estimate.hpp>

#include "catch.hpp"

using namespace decant;

namespace {

constexpr double apart = 1.5;        // [m] from cup to cup
constexpr double pour_height = 0.3;  // [m]

/// Dust in two cups that lets itself out into the pans below, faster or slower: each grain by itself, so that what is
/// in one cup cannot matter to the other to the last bit.
template <class ScalarType>
struct PouredDust {
  using Scalar = ScalarType;
  struct Body {
    std::shared_ptr<const BoundingVolumeHierarchy> surface;
    PoseTrack motion;
  };
  struct Report {
    bool went_well = true;
    bool advanced() const { return went_well; }
  };

  static constexpr double grain = 0.02;

  FluidState<Scalar> dust{};
  std::vector<Body> scene{};
  std::vector<Scalar> gravity{};  // of each grain [m/s^2]
  double now = 0;
  bool broken = false;

  /// A cup over a pan, and another pair; and a sign that stands before the first cup's left half, out of all reach.
  explicit PouredDust(const Vector3<double>& second = {apart, 0, 0}) {
    const auto body = [&](const TriangleMesh& mesh, const Vector3<double>& place) {
      scene.push_back({std::make_shared<const BoundingVolumeHierarchy>(mesh),
                       PoseTrack(Pose{Eigen::Quaterniond::Identity(), place})});
    };
    for (const Vector3<double>& place : {Vector3<double>(0, 0, 0), second}) {
      body(Cup{0.03, 0.04, 0.09, 0.003}.mesh(), place + Vector3<double>(0, 0, pour_height));
      body(CylinderInside{0.13, 0.045, 0.003, Face::PositiveZ}.mesh(), place);
    }
    body(Box{{-0.045, -0.005, 0}, {0, 0.005, 0.7}}.mesh(), {0.375, -2, 0});
  }

  /// Layers of dust above a pan that fall with that acceleration.
  void pour(const Vector3<double>& place, int layers, double acceleration) {
    const Index before = dust.size(), count = 64 * layers;
    dust.resize(before + count);
    for (Index i = 0; i < count; ++i) {
      const Vector3<double> at(static_cast<double>(i % 8) - 3.5, static_cast<double>(i / 8 % 8) - 3.5,
                               static_cast<double>(i / 64));
      dust.position.col(before + i) =
          (place + Vector3<double>(0, 0, pour_height - 0.1) + grain * at).template cast<Scalar>();
      dust.velocity.col(before + i).setZero();
      gravity.push_back(static_cast<Scalar>(acceleration));
    }
  }

  FluidState<Scalar>& fluid() { return dust; }
  double time() const { return now; }
  double spacing() const { return grain; }
  const std::vector<Body>& bodies() const { return scene; }
  void move_body(BodyId, const Pose&, double) {}
  Report step(double duration) {
    if (broken) {
      return {false};
    }
    now += duration;
    const auto by = static_cast<Scalar>(duration);
    for (Index i = 0; i < dust.size(); ++i) {
      dust.velocity(2, i) -= gravity[static_cast<std::size_t>(i)] * by;
      dust.position(2, i) = std::max<Scalar>(Scalar(0.02), dust.position(2, i) + dust.velocity(2, i) * by);
    }
    return {};
  }
};
static_assert(LiquidModel<PouredDust<float>>);

template <class Scalar, class CorrectorType = OpenLoop<Scalar>>
using DustPourTracker = Tracker<PouredDust<Scalar>, CorrectorType>;

PosedCamera<DistortedPinholeCamera> camera_before(double middle) {
  Matrix3<double> axes;
  axes << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  const Vector3<double> place(middle, -4, 0.2);
  return PosedCamera<DistortedPinholeCamera>({PinholeCamera(700, 700, 319.5, 239.5, 640, 480), {}},
                                             Pose{Eigen::Quaterniond(axes), -(axes * place)});
}

/// Hypotheses: the first cup's dust falls with 1, 2 or 3 m/s^2, the second's is 4 or 8 layers high.
constexpr std::size_t accelerations = 3, heights = 2;

template <class Scalar, class CorrectorType = OpenLoop<Scalar>>
DustPourTracker<Scalar, CorrectorType> dust_tracker(std::optional<std::size_t> acceleration,
                                                    std::optional<std::size_t> height,
                                                    const Vector3<double>& second = {apart, 0, 0}) {
  PouredDust<Scalar> model(second);
  if (acceleration) {
    model.pour({0, 0, 0}, 6, 1.0 + static_cast<double>(*acceleration));
  }
  if (height) {
    model.pour(second, 4 * (1 + static_cast<int>(*height)), 1.5);
  }
  TrackerSettings settings;
  settings.threads = {1};
  DustPourTracker<Scalar, CorrectorType> tracker(model, {}, settings);
  const auto camera = camera_before(0.5 * apart);
  tracker.add_camera(camera.camera(), camera.camera_from_world());
  return tracker;
}

std::vector<HypothesisGroup> groups_of_dust(int cell_px, const Vector3<double>& second = {apart, 0, 0}) {
  const std::vector<BodyId> cups{0, 2};
  const std::vector cameras{camera_before(0.5 * apart)};
  return hypothesis_groups<std::vector<PouredDust<double>::Body>, DistortedPinholeCamera>(
      PouredDust<double>(second).bodies(), cups, {}, cameras, cell_px);
}

HypothesisFilterSettings for_dust() {
  HypothesisFilterSettings settings;
  settings.cell_px = 12;  // 640 is no multiple of it
  settings.least_probability = 0;
  settings.posterior.least_squared = 2;  // grains are few
  return settings;
}

template <class Scalar, class CorrectorType = OpenLoop<Scalar>>
FactoredFilter<DustPourTracker<Scalar, CorrectorType>> factored_dust(HypothesisFilterSettings settings = for_dust(),
                                                                     const Vector3<double>& second = {apart, 0, 0},
                                                                     int threads = 1) {
  return FactoredFilter<DustPourTracker<Scalar, CorrectorType>>(
      groups_of_dust(settings.cell_px, second), {{0, 0.3, -0.2}, {0.1, 0}},
      [&](std::span<const std::optional<std::size_t>> chosen) {
        return dust_tracker<Scalar, CorrectorType>(chosen[0], chosen[1], second);
      },
      settings, ThreadExecutor{{threads}});
}

/// What is seen, frame by frame: neither of the hypotheses, and clutter on the wall in between and behind.
template <class Scalar>
std::vector<Mask> seen_dust(int frames, const Vector3<double>& second = {apart, 0, 0}) {
  auto reality = dust_tracker<Scalar>(std::nullopt, std::nullopt, second);
  PouredDust<Scalar> model(second);
  model.pour({0, 0, 0}, 5, 1.8);
  model.pour(second, 7, 1.4);
  std::vector<Mask> masks;
  for (int frame = 0; frame < frames; ++frame) {
    model.step(1 / 30.0);
    Mask mask;
    reality.predict(model, 0, mask);
    mask.block(100, 318, 10, 12) = mask_liquid;  // between the groups
    mask.block(2, 100, 5, 12) = mask_liquid;
    mask.block(180 + frame, 500, 10, 10) = mask_liquid;  // where the second one's liquid might be
    masks.push_back(mask);
  }
  return masks;
}

template <class Scalar>
void same_as_full_product() {
  constexpr int frames = 12;
  auto factored = factored_dust<Scalar>();
  REQUIRE(factored.groups().size() == 2);
  CHECK(factored.simulations().size() == accelerations + heights);
  REQUIRE(factored.combinations() == accelerations * heights);
  // each has its own group's liquid alone
  CHECK(factored.tracker(0).model().dust.size() == 64 * 6);
  CHECK(factored.tracker(accelerations).model().dust.size() == 64 * 4);
  CHECK(factored.tracker(accelerations + 1).model().dust.size() == 64 * 8);

  const std::vector<std::vector<double>> log_prior{{0, 0.3, -0.2}, {0.1, 0}};
  HypothesisFilter<DustPourTracker<Scalar>> full(for_dust());
  for (std::size_t i = 0; i < accelerations; ++i) {
    for (std::size_t j = 0; j < heights; ++j) {
      full.add(dust_tracker<Scalar>(i, j), log_prior[0][i] + log_prior[1][j]);
    }
  }
  double time = 0;
  for (const Mask& mask : seen_dust<Scalar>(frames)) {
    time += 1 / 30.0;
    const std::vector<CameraMask> masks{{0, mask}};
    REQUIRE(full.track({time, {}, masks}).status == FrameStatus::Ok);
    REQUIRE(factored.track({time, {}, masks}) == FrameStatus::Ok);
    double marginal = 0;
    for (std::size_t i = 0; i < accelerations; ++i) {
      for (std::size_t j = 0; j < heights; ++j) {
        // sums of some thousand cells, in another order
        CHECK(factored.log_posterior({i, j}) == Approx(full.log_posterior(heights * i + j)).epsilon(1e-12));
        CHECK(factored.probability({i, j}) == Approx(full.probability(heights * i + j)).epsilon(1e-10));
      }
      marginal += factored.probability(0, i);
      CHECK(factored.probability(0, i) ==
            Approx(full.probability(heights * i) + full.probability(heights * i + 1)).epsilon(1e-10));
    }
    CHECK(factored.probability_of_none() == Approx(full.probability_of_none()).epsilon(1e-10));
    CHECK(marginal + factored.probability_of_none() == Approx(1));
    CHECK(factored.best() == std::vector<std::size_t>{full.best() / heights, full.best() % heights});
  }
  // there was something to be told apart, and something that was not explained
  CHECK(factored.best() == std::vector<std::size_t>{1, 1});
  CHECK(factored.probability({1, 1}) < 0.999);
  CHECK(factored.probability({1, 0}) > 1e-6);
  CHECK(factored.probability(1, 1) > factored.probability({1, 1}));
}

}  // namespace

TEST_CASE("factored filter: five simulations have the posterior of all six combinations") {
  SECTION("float") { same_as_full_product<float>(); }
  SECTION("double") { same_as_full_product<double>(); }
}

TEST_CASE("factored filter: what its equality rests on is there") {
  // groups have no cell in common, and bodies of none of them hide what belongs to one
  const auto groups = groups_of_dust(12);
  REQUIRE(groups.size() == 2);
  CHECK(groups[0].sources == std::vector<std::size_t>{0});
  CHECK(groups[1].sources == std::vector<std::size_t>{1});
  CHECK(groups[0].pixels[0].intersection(groups[1].pixels[0]).empty());
  for (const HypothesisGroup& group : groups) {
    CHECK(group.pixels[0].u_begin % 12 == 0);
    CHECK((group.pixels[0].u_end % 12 == 0 || group.pixels[0].u_end == 640));
    CHECK(std::count(group.scene.bodies.begin(), group.scene.bodies.end(), BodyId{4}) == 0);
  }
  // without the sign more of the first cup's dust is seen
  auto tracker = dust_tracker<double>(0, std::nullopt);
  PouredDust<double> model;
  model.pour({0, 0, 0}, 5, 1.8);
  Mask behind_sign, in_the_open;
  tracker.predict(model, 0, behind_sign);
  model.scene[4].motion = PoseTrack(Pose{Eigen::Quaterniond::Identity(), {-5, -2, 0}});
  tracker.predict(model, 0, in_the_open);
  CHECK((behind_sign > 0).count() > 50);
  CHECK((in_the_open > 0).count() > (behind_sign > 0).count() + 50);
}

TEST_CASE("factored filter: containers that may share liquid are simulated in every combination") {
  const Vector3<double> beside(0.5, 0, 0);
  auto factored = factored_dust<double>(for_dust(), beside);
  REQUIRE(factored.groups().size() == 1);
  CHECK(factored.simulations().size() == accelerations * heights);
  HypothesisFilter<DustPourTracker<double>> full(for_dust());
  const std::vector<std::vector<double>> log_prior{{0, 0.3, -0.2}, {0.1, 0}};
  for (std::size_t i = 0; i < accelerations; ++i) {
    for (std::size_t j = 0; j < heights; ++j) {
      full.add(dust_tracker<double>(i, j, beside), log_prior[0][i] + log_prior[1][j]);
    }
  }
  double time = 0;
  for (const Mask& mask : seen_dust<double>(6, beside)) {
    time += 1 / 30.0;
    const std::vector<CameraMask> masks{{0, mask}};
    REQUIRE(full.track({time, {}, masks}).status == FrameStatus::Ok);
    REQUIRE(factored.track({time, {}, masks}) == FrameStatus::Ok);
  }
  for (std::size_t i = 0; i < accelerations; ++i) {
    for (std::size_t j = 0; j < heights; ++j) {
      CHECK(factored.probability({i, j}) == Approx(full.probability(heights * i + j)).epsilon(1e-10));
      CHECK(factored.simulation(0, {i, j}) == heights * i + j);
    }
  }
}

TEST_CASE("factored filter: containers that are seen one before the other are simulated in every combination") {
  const Vector3<double> behind(0.3, 3, 0);
  const std::vector<BodyId> cups{0, 2};
  REQUIRE(independent_groups(PouredDust<double>(behind).bodies(), cups, {}).size() == 2);
  const auto groups = groups_of_dust(12, behind);
  REQUIRE(groups.size() == 1);
  CHECK(groups[0].sources == std::vector<std::size_t>{0, 1});
  CHECK(factored_dust<double>(for_dust(), behind).simulations().size() == accelerations * heights);
}

TEST_CASE("factored filter: correctors pull each group's liquid to what is seen of it, and not to the other's") {
  auto factored = factored_dust<double, TransportCorrector<double>>();
  const PixelBox own = factored.groups()[0].pixels[0];
  // as if the other group were not there
  auto alone = dust_tracker<double, TransportCorrector<double>>(2, std::nullopt);
  auto uncorrected = dust_tracker<double>(2, std::nullopt);
  double time = 0;
  for (const Mask& mask : seen_dust<double>(8)) {
    time += 1 / 30.0;
    Mask of_own = Mask::Zero(mask.rows(), mask.cols());
    of_own.block(own.v_begin, own.u_begin, own.height(), own.width()) =
        mask.block(own.v_begin, own.u_begin, own.height(), own.width());
    const std::vector<CameraMask> masks{{0, mask}}, masks_of_own{{0, of_own}};
    REQUIRE(factored.track({time, {}, masks}) == FrameStatus::Ok);
    REQUIRE(alone.track({time, {}, masks_of_own}).status == FrameStatus::Ok);
    REQUIRE(uncorrected.track({time, {}, masks_of_own}).status == FrameStatus::Ok);
  }
  const auto& corrected = factored.tracker(factored.simulation(0, {2, 0})).model().fluid();
  CHECK(corrected.position == alone.model().fluid().position);
  CHECK((corrected.position - uncorrected.model().fluid().position).cwiseAbs().maxCoeff() > 0.01);
  CHECK(factored.best()[0] == 1);
}

TEST_CASE("factored filter: gives up simulations that are in no probable combination") {
  HypothesisFilterSettings settings = for_dust();
  settings.least_probability = 0.02;
  auto pruned = factored_dust<double>(settings);
  auto all = factored_dust<double>();
  double time = 0;
  std::vector<double> behind;
  for (const Mask& mask : seen_dust<double>(14)) {
    time += 1 / 30.0;
    const std::vector<CameraMask> masks{{0, mask}};
    const std::size_t before = pruned.simulations().running();
    REQUIRE(all.track({time, {}, masks}) == FrameStatus::Ok);
    REQUIRE(pruned.track({time, {}, masks}) == FrameStatus::Ok);
    for (std::size_t k = 0; k < all.simulations().size() && before == 5; ++k) {
      // the best combination that it is in decides, with what is known of the other group
      double own = -std::numeric_limits<double>::infinity();
      for (std::size_t other = 0; other < (k < accelerations ? heights : accelerations); ++other) {
        own = std::max(
            own, k < accelerations ? all.log_posterior({k, other}) : all.log_posterior({other, k - accelerations}));
      }
      const bool improbable = std::exp(own - all.log_posterior(all.best())) < settings.least_probability;
      CHECK(pruned.simulations().given_up(k) == improbable);
      if (improbable) {
        const std::vector<std::size_t> choice =
            k < accelerations ? std::vector<std::size_t>{k, 1} : std::vector<std::size_t>{1, k - accelerations};
        behind.push_back(all.log_posterior(all.best()) - all.log_posterior(choice));
        CHECK(pruned.log_posterior(pruned.best()) - pruned.log_posterior(choice) == Approx(behind.back()));
      }
    }
  }
  CHECK(!behind.empty());
  CHECK(pruned.simulations().running() < 5);
  CHECK(pruned.best() == all.best());
  CHECK(pruned.probability(pruned.best()) == Approx(all.probability(all.best())).margin(0.1));
  CHECK(pruned.log_posterior(1, 0) > -std::numeric_limits<double>::infinity());
  CHECK(pruned.log_posterior(1, 0) < pruned.log_posterior(1, 1));
}

TEST_CASE("factored filter: a model that fails is given up, and a group without any is said") {
  auto factored = factored_dust<double>();
  factored.tracker(0).model().broken = true;
  CHECK(factored.track({0.1, {}, {}}) == FrameStatus::Uncorrected);
  CHECK(factored.probability(0, 0) == 0);
  CHECK(factored.probability(1, 0) > 0);
  CHECK(factored.log_posterior({0, 0}) == -std::numeric_limits<double>::infinity());
  CHECK(factored.track({0.05, {}, {}}) == FrameStatus::Late);
  factored.tracker(3).model().broken = factored.tracker(4).model().broken = true;
  CHECK(factored.track({0.2, {}, {}}) == FrameStatus::ModelFailed);
  CHECK(factored.probability_of_none() == Approx(1));
}

TEST_CASE("factored filter: before anything is seen there is the prior, and the amounts of a source are a density") {
  HypothesisFilterSettings settings = for_dust();
  settings.posterior.none_prior = 0;
  auto factored = factored_dust<double>(settings);
  CHECK(factored.probability(1, 0) == Approx(std::exp(0.1) / (std::exp(0.1) + 1)));
  CHECK(factored.probability({2, 1}) ==
        Approx(std::exp(-0.2) / (1 + std::exp(0.3) + std::exp(-0.2)) / (std::exp(0.1) + 1)));
  const std::vector<double> values{1, 2, 3};
  const std::vector<double> log_density{factored.log_posterior(0, 0), factored.log_posterior(0, 1),
                                        factored.log_posterior(0, 2)};
  CHECK(log_density[1] - log_density[2] == Approx(0.5));
  CHECK(estimate_value(values, log_density).mean == Approx(2).margin(0.2));
}

TEST_CASE("factored filter: the same bits for 1, 2 and 4 threads", "[threads]") {
  const auto posterior_with = [](int threads) {
    auto factored = factored_dust<double>(for_dust(), {apart, 0, 0}, threads);
    double time = 0;
    for (const Mask& mask : seen_dust<double>(4)) {
      time += 1 / 30.0;
      const std::vector<CameraMask> masks{{0, mask}};
      REQUIRE(factored.track({time, {}, masks}) == FrameStatus::Ok);
    }
    std::vector<double> all;
    for (std::size_t i = 0; i < accelerations; ++i) {
      all.insert(all.end(), {factored.log_posterior({i, 0}), factored.log_posterior({i, 1})});
    }
    return all;
  };
  const std::vector<double> alone = posterior_with(1);
  CHECK(posterior_with(2) == alone);
  CHECK(posterior_with(4) == alone);
}

TEST_CASE("factored filter: what does not fit is refused") {
  using Filter = FactoredFilter<DustPourTracker<double>>;
  const auto make = [](std::span<const std::optional<std::size_t>> chosen) {
    return dust_tracker<double>(chosen[0], chosen[1]);
  };
  CHECK_THROWS_WITH(Filter(groups_of_dust(12), {{0}}, make), Catch::Contains("source of a group"));
  CHECK_THROWS_WITH(Filter(groups_of_dust(12), {{0}, {0}, {0}}, make), Catch::Contains("groups of each source"));
  CHECK_THROWS_WITH(Filter(groups_of_dust(12), {{0}, {}}, make), Catch::Contains("at least one"));
  CHECK_THROWS_WITH(Filter(groups_of_dust(12), {{0}, {std::nan("")}}, make), Catch::Contains("log_prior"));
  CHECK_THROWS_WITH(Filter(groups_of_dust(12), {std::vector<double>(1001), std::vector<double>(1000)}, make),
                    Catch::Contains("at most a million"));
  HypothesisFilterSettings settings;
  settings.least_probability = 1;
  CHECK_THROWS_WITH(Filter(groups_of_dust(12), {{0}, {0}}, make, settings), Catch::Contains("least_probability"));
  const auto blind = [](std::span<const std::optional<std::size_t>>) {
    return DustPourTracker<double>(PouredDust<double>());
  };
  CHECK_THROWS_WITH(Filter(groups_of_dust(12), {{0}, {0}}, blind), Catch::Contains("cameras of a tracker"));
  Filter filter(groups_of_dust(12), {{0}, {0}}, make);
  CHECK_THROWS_WITH(filter.probability({0, 1}), Catch::Contains("one of the source's"));
  CHECK_THROWS_WITH(filter.probability({0}), Catch::Contains("number of sources"));
  CHECK_THROWS_WITH(filter.simulation(2, {0, 0}), Catch::Contains("one of its groups"));
  CHECK_THROWS_WITH(groups_of_dust(0), Catch::Contains("cell_px"));
  const std::vector<BodyId> twice{0, 0};
  const std::vector cameras{camera_before(0)};
  CHECK_THROWS_WITH((hypothesis_groups<std::vector<PouredDust<double>::Body>, DistortedPinholeCamera>(
                        PouredDust<double>().bodies(), twice, {}, cameras)),
                    Catch::Contains("named once"));
}
