// SPDX-License-Identifier: MIT
// Correctors on a block of liquid whose silhouette was seen somewhere else.

#include <array>
#include <cmath>
#include <limits>
#include <memory>

#include <decant/boundary/shapes.hpp>
#include <decant/correction/edge_fit.hpp>
#include <decant/correction/map_filter.hpp>
#include <decant/correction/map_filter_schenck2017.hpp>
#include <decant/correction/mass_relocation.hpp>
#include <decant/correction/open_loop.hpp>
#include <decant/correction/silhouette_corrector.hpp>
#include <decant/correction/transport_corrector.hpp>
#include <decant/correction/warp_field_schenck2017.hpp>
#include <decant/testing/corrector.hpp>

#include "catch.hpp"
#include "correction/seen.hpp"

using decant::Index;
using decant::Vector3;
using decant_test::Eye;
using decant_test::liquid_block;
using decant_test::observation;

namespace {

template <class Scalar>
Vector3<double> middle(const decant::FluidState<Scalar>& fluid) {
  return fluid.position.rowwise().mean().template cast<double>();
}

/// All passes of a corrector over one frame.
template <class CorrectorType, class Scalar, std::size_t Count>
decant::CorrectionReport correct(CorrectorType& corrector, decant::FluidState<Scalar>& fluid,
                                 std::array<Eye<Scalar>*, Count> eyes, decant::Threads threads = {1}) {
  int passes = 1;
  if constexpr (requires { corrector.passes(); }) {
    passes = corrector.passes();
  }
  decant::CorrectionReport all;
  for (int pass = 0; pass < passes; ++pass) {
    std::vector<decant::SilhouetteView<decant::DistortedPinholeCamera>> views;
    for (Eye<Scalar>* eye : eyes) {
      views.push_back(eye->predict(fluid));
    }
    const auto report = corrector.correct(fluid, observation(views, pass, threads), Scalar(1.0 / 30));
    all.moved += report.moved;
    all.mean_shift += report.mean_shift;
  }
  return all;
}

}  // namespace

TEMPLATE_TEST_CASE("transport corrector: one camera moves the liquid across its sight, and never in depth", "", float,
                   double) {
  const Vector3<double> there(0.012, 0.02, -0.008);  // of which the camera sees the first and the last
  auto fluid = liquid_block<TestType>({0, 0, 0});
  Eye<TestType> eye(decant_test::before_the_block());
  eye.observe(liquid_block<TestType>(there));
  decant::TransportCorrector<TestType> corrector;
  for (int frame = 0; frame < 4; ++frame) {
    correct(corrector, fluid, std::array{&eye});
  }
  const Vector3<double> now = middle(fluid);
  INFO("middle [mm] " << 1e3 * now.transpose());
  // a pixel is 1 mm here; the block is seen 4 % smaller from where it was seen, which moves no middle
  CHECK(now.x() == Approx(there.x()).margin(0.0015));
  CHECK(now.z() == Approx(there.z()).margin(0.0015));
  CHECK(std::abs(now.y()) < 0.0015);
  CHECK(fluid.velocity.row(0).mean() > 0);  // it was taken to be late
}

TEST_CASE("transport corrector: two cameras find the place in space") {
  const Vector3<double> there(0.010, -0.012, 0.006);
  auto fluid = liquid_block<float>({0, 0, 0});
  Eye<float> before(decant_test::before_the_block()), beside(decant_test::beside_the_block());
  before.observe(liquid_block<float>(there));
  beside.observe(liquid_block<float>(there));
  decant::TransportCorrector<> corrector;
  for (int frame = 0; frame < 4; ++frame) {
    correct(corrector, fluid, std::array{&before, &beside});
  }
  INFO("middle [mm] " << 1e3 * middle(fluid).transpose());
  CHECK((middle(fluid) - there).norm() < 0.0025);
}

TEST_CASE("transport corrector: a right prediction stays as it is") {
  auto fluid = liquid_block<double>({0.003, 0.01, -0.002});
  const auto start = fluid;
  Eye<double> eye(decant_test::before_the_block());
  eye.observe(fluid);
  decant::TransportCorrector<double> corrector;
  correct(corrector, fluid, std::array{&eye});
  CHECK((fluid.position - start.position).colwise().norm().maxCoeff() < 1e-4);  // a tenth of a pixel
  CHECK(fluid.velocity == start.velocity);                                      // below the gate
}

TEST_CASE("transport corrector: what is hidden stays") {
  auto fluid = liquid_block<float>({0, 0, 0});
  const auto start = fluid;
  Eye<float> eye(decant_test::before_the_block());
  eye.observe(liquid_block<float>({0.01, 0, 0}));
  // a plate before the left half
  eye.sight.add(
      std::make_shared<const decant::BoundingVolumeHierarchy>(decant::Box{{-0.1, -0.11, -0.1}, {0, -0.1, 0.1}}.mesh()));
  decant::TransportCorrector<> corrector;
  correct(corrector, fluid, std::array{&eye});
  double left = 0, right = 0;
  for (Index i = 0; i < fluid.size(); ++i) {
    const double moved = static_cast<double>((fluid.position.col(i) - start.position.col(i)).norm());
    (start.position(0, i) < 0 ? left : right) += moved;
  }
  CHECK(left == 0);
  CHECK(right > 0.1);  // 256 particles by some millimetres
}

TEST_CASE("correctors: the same bits for any number of threads") {
  const auto require_same = [](auto make) {
    constexpr int deep = 32;
    static_assert(64 * deep >= 4 * decant::least_per_thread);  // else some threads have no work
    Eye<float> eye(decant_test::before_the_block());
    eye.observe(liquid_block<float>({0.01, 0, 0.004}, deep));
    decant::FluidState<float> first;
    for (int threads : {1, 2, 4}) {
      auto fluid = liquid_block<float>({0, 0, 0}, deep);
      auto corrector = make();
      correct(corrector, fluid, std::array{&eye}, {threads});
      if (threads == 1) {
        first = fluid;
      }
      REQUIRE(fluid.position == first.position);
      REQUIRE(fluid.velocity == first.velocity);
    }
    const auto untouched = liquid_block<float>({0, 0, 0}, deep);
    REQUIRE((first.position != untouched.position || first.velocity != untouched.velocity));
  };
  require_same([] { return decant::TransportCorrector<>(); });
  require_same([] { return decant::EdgeFit<>(); });
  require_same([] { return decant::SilhouetteCorrector<>(); });
  require_same([] { return decant::MapFilter<>(); });
  require_same([] { return decant::MapFilterSchenck2017<>(); });
  require_same([] { return decant::WarpFieldSchenck2017<>(); });
}

TEST_CASE("MAP filter: liquid that is beside where it is seen goes there in a few frames, and a right one stays") {
  auto fluid = liquid_block<double>({0, 0, 0});
  const auto start = fluid;
  Eye<double> eye(decant_test::before_the_block());
  eye.observe(liquid_block<double>({0.012, 0, -0.008}));
  decant::MapFilter<double> filter;
  // what is left empty behind it fills up only by the relaxation that follows a correction in the Tracker
  const auto misplaced = [&] { return (eye.predicted >= 128 && eye.observed < 128).count(); };
  eye.predict(fluid);
  const auto before = misplaced();
  for (int frame = 0; frame < 4; ++frame) {
    correct(filter, fluid, std::array{&eye});
  }
  eye.predict(fluid);
  INFO(before << " misplaced pixels, then " << misplaced());
  CHECK(misplaced() < before / 5);
  const Eigen::Vector3d shift = (fluid.position - start.position).rowwise().mean();
  CHECK(shift.x() > 0.008);
  CHECK(shift.z() < -0.005);
  CHECK(std::abs(shift.y()) < 0.002);          // one camera says nothing of depth
  CHECK(fluid.velocity.row(0).mean() > 0.01);  // and it moves on that way

  fluid = start;
  eye.observe(start);
  CHECK(correct(filter, fluid, std::array{&eye}).moved == 0);
  CHECK(fluid.position == start.position);
}

TEST_CASE("MAP filter: liquid at the picture's edge does not leave it, and an empty mask moves nothing") {
  auto fluid = liquid_block<double>({0, 0, 0});
  fluid.resize(1);
  // half a pixel within the right edge of 200 columns: 500 px per metre at half a metre's depth
  fluid.position.col(0) << 0.0995, 0, 0;
  const auto start = fluid;
  Eye<double> eye(decant_test::before_the_block()), other(decant_test::beside_the_block());
  eye.observed.block(70, 20, 10, 10).setConstant(decant::mask_liquid);  // far to the left, beyond the reach
  other.observed.setConstant(decant::mask_liquid);
  decant::MapFilter<double> filter;
  correct(filter, fluid, std::array{&eye, &other});
  CHECK(eye.sight.camera().project(Vector3<double>(fluid.position.col(0))).visible);

  fluid = start;
  eye.observed.setZero();
  CHECK(correct(filter, fluid, std::array{&eye}).moved == 0);
  CHECK(fluid.position == start.position);
}

TEST_CASE("printed MAP filter: the best of 27 places by the activation, and a velocity that follows") {
  auto fluid = liquid_block<double>({0, 0, 0});
  fluid.resize(1);
  fluid.position.col(0) << 0, 0, 0;
  Eye<double> eye(decant_test::before_the_block());
  eye.observed.block(70, 130, 10, 10).setConstant(decant::mask_liquid);  // right of the particle, a little above it
  decant::MapFilterSchenck2017<double> filter;
  const auto views = std::array{eye.predict(fluid)};
  const auto report = filter.correct(fluid, observation(views), 1.0 / 30);
  CHECK(report.moved == 1);
  // by hand: of all places the one whose pixel is nearest to the patch, so right, up, and nearer to the camera, where a
  // step of 5 mm takes more pixels
  CHECK(fluid.position.col(0).isApprox(Vector3<double>(0.005, -0.005, 0.005)));
  CHECK(fluid.velocity.col(0).isApprox(30 * Vector3<double>(0.005, -0.005, 0.005)));

  // a wall right of the particle: paths that cross it are struck out
  fluid.position.col(0) << 0, 0, 0;
  fluid.velocity.setZero();
  eye.sight.add(std::make_shared<const decant::BoundingVolumeHierarchy>(
      decant::Box{{0.002, -0.02, -0.1}, {0.003, 0.1, 0.1}}.mesh()));
  const auto walled = std::array{eye.predict(fluid)};
  filter.correct(fluid, observation(walled), 1.0 / 30);
  CHECK(fluid.position(0, 0) <= 0);
  CHECK(fluid.position(2, 0) == Approx(0.005));

  // nothing seen, nothing better: the prediction stays
  fluid.position.col(0) << 0, 0, 0;
  eye.observed.setZero();
  const auto blind = std::array{eye.predict(fluid)};
  CHECK(filter.correct(fluid, observation(blind), 1.0 / 30).moved == 0);
}

TEST_CASE("warp field: pulls toward what was seen, parallel to the image, and is felt by hidden neighbours") {
  auto fluid = liquid_block<double>({0, 0, 0});
  fluid.resize(2);
  fluid.position.col(0) << 0, 0, 0;
  fluid.position.col(1) << 0, 0.004, 0;
  Eye<double> eye(decant_test::before_the_block());
  eye.observed(79, 130) = decant::mask_liquid;  // 30.5 px right and half a pixel up of where the origin is seen
  decant::WarpFieldSchenck2017Settings settings;
  settings.strength = 2;
  decant::WarpFieldSchenck2017<double> field(settings);
  auto view = eye.predict(fluid);
  eye.hidden[1] = 1;
  view.hidden = eye.hidden;
  eye.drawing.render(fluid.position, eye.hidden, eye.sight.camera().camera(), eye.sight.camera().camera_from_world(),
                     eye.predicted);
  const auto views = std::array{view};
  field.correct(fluid, observation(views), 0.5);
  // the sum by hand: one pixel, u = (30.5, -0.5) px, not covered; a pixel is a millimetre
  const double u = 30.5, v = -0.5, weight = std::exp(-(u * u + v * v) / (33 * 33));
  const double h = 2 * 0.005 / decant::CubicSpline<double>::support_factor, volume = std::pow(0.005, 3);
  const Vector3<double> pull = 2 * weight * 1e-3 * Vector3<double>(u, 0, -v);
  const Vector3<double> own = 0.5 * volume * decant::CubicSpline<double>::value(0.0, h) * pull;
  const Vector3<double> felt = 0.5 * volume * decant::CubicSpline<double>::value(0.004, h) * pull;
  CHECK((fluid.velocity.col(0) - own).norm() < 2e-3 * own.norm());  // the look-up's own error is 1e-3 at most
  CHECK((fluid.velocity.col(1) - felt).norm() < 2e-3 * felt.norm());
}

TEST_CASE("mass relocation: fills what is seen two frames running from what is nowhere seen, and counts its moves") {
  // a block that is seen, a clump right of it that is not, and liquid left of it that is seen and not simulated
  auto fluid = liquid_block<float>({0, 0, 0});
  for (Index i = 0; i < 64; ++i) {
    fluid.position.col(i) += Eigen::Vector3f(0.06f, 0, 0.02f);
  }
  const auto start = fluid;
  Eye<float> eye(decant_test::before_the_block());
  eye.observe(start);
  eye.observed.rightCols(62).setZero();
  eye.observed.block(60, 50, 20, 20).setConstant(decant::mask_liquid);
  decant::MassRelocation<> relocation;
  CHECK(correct(relocation, fluid, std::array{&eye}).moved == 0);  // seen once: may be noise
  CHECK(fluid.position == start.position);
  auto views = std::array{eye.predict(fluid)};
  const auto report = relocation.correct(fluid, observation(views), 1.0f / 30);
  CHECK(report.relocated > 5);
  CHECK(report.relocated <= 20);  // 4 % of 512
  Index changed = 0;
  for (Index i = 0; i < fluid.size(); ++i) {
    if (fluid.position.col(i) == start.position.col(i)) {
      continue;
    }
    ++changed;
    CHECK(start.position(0, i) > 0.03f);  // from the clump
    const auto now = eye.sight.camera().project(fluid.position.col(i).cast<double>());
    CHECK(now.visible);
    CHECK(std::abs(now.pixel.x() - 59.5) < 11);  // to where liquid is seen
    CHECK(std::abs(now.pixel.y() - 69.5) < 11);
    CHECK(now.depth == Approx(0.5).margin(0.02));  // at the depth of the liquid next to it
  }
  CHECK(changed == report.relocated);
  // after a reset nothing is known of the frame before
  auto again = start;
  relocation.reset();
  CHECK(correct(relocation, again, std::array{&eye}).moved == 0);
  // and what is seen in one place now and in another then is not seen two frames running
  eye.observed.block(60, 50, 20, 20).setZero();
  eye.observed.block(100, 50, 20, 20).setConstant(decant::mask_liquid);
  CHECK(correct(relocation, again, std::array{&eye}).moved == 0);
  CHECK(correct(relocation, again, std::array{&eye}).moved > 5);
}

TEST_CASE(
    "mass relocation: hidden liquid gives what the image shows more, from its top, and takes back what it shows less") {
  // the upper half stands behind a plate, the lower half is in sight
  auto fluid = liquid_block<float>({0, 0, 0});
  Eye<float> eye(decant_test::before_the_block());
  eye.sight.add(
      std::make_shared<const decant::BoundingVolumeHierarchy>(decant::Box{{-0.1, -0.11, 0}, {0.1, -0.1, 0.1}}.mesh()));
  eye.observe(fluid);
  decant::MassRelocation<> relocation;
  const auto start = fluid;
  eye.observed.block(100, 85, 30, 30).setConstant(decant::mask_liquid);  // more below
  correct(relocation, fluid, std::array{&eye});
  CHECK(correct(relocation, fluid, std::array{&eye}).moved > 3);
  for (Index i = 0; i < fluid.size(); ++i) {
    if (fluid.position.col(i) != start.position.col(i)) {
      CHECK(start.position(2, i) > 0.01f);  // of 20 mm: from the top of what is hidden
      CHECK(fluid.position(2, i) < -0.01f);
    }
  }
  // less than is simulated: a clump that fell too early goes back behind the plate
  fluid = start;
  for (Index i = 256; i < 384; ++i) {
    fluid.position(2, i) -= 0.045f;  // out of the hidden half
  }
  eye.observe(start);
  relocation.reset();
  const auto before = fluid;
  CHECK(correct(relocation, fluid, std::array{&eye}).moved > 3);
  for (Index i = 0; i < fluid.size(); ++i) {
    if (fluid.position.col(i) != before.position.col(i)) {
      CHECK(before.position(2, i) < -0.035f);
      CHECK(fluid.position(2, i) > 0);
    }
  }
}

TEST_CASE("mass relocation: liquid that comes into sight where none is simulated comes from behind the wall, falling") {
  auto fluid = liquid_block<double>({0, 0, 0.03});
  Eye<double> eye(decant_test::before_the_block());
  eye.sight.add(std::make_shared<const decant::BoundingVolumeHierarchy>(
      decant::Box{{-0.1, -0.11, 0}, {0.1, -0.1, 0.1}}.mesh()));  // hides all of it
  REQUIRE(eye.predict(fluid).predicted->maxCoeff() == 0);
  eye.observed.block(100, 90, 12, 12).setConstant(decant::mask_liquid);  // 3 cm below the middle
  const auto start = fluid;
  decant::MassRelocation<double> relocation;
  correct(relocation, fluid, std::array{&eye});
  const auto views = std::array{eye.predict(fluid)};
  REQUIRE(relocation.correct(fluid, observation(views), 1.0 / 30).relocated >= 1);
  const double bottom = start.position.row(2).minCoeff();
  for (Index i = 0; i < fluid.size(); ++i) {
    if (fluid.position.col(i) != start.position.col(i)) {
      const double fallen = bottom - fluid.position(2, i);
      CHECK(fallen > 0.01);
      CHECK(fluid.velocity(2, i) == Approx(-std::sqrt(2 * 9.81 * fallen)).epsilon(0.05));
      CHECK(fluid.position(1, i) == Approx(0).margin(0.025));  // at the depth of what is behind the wall
    }
  }
}

TEST_CASE("correctors: their laws") {
  const auto fluid = liquid_block<float>({0, 0, 0});
  Eye<float> right(decant_test::before_the_block()), wrong(decant_test::before_the_block());
  right.observe(fluid);
  wrong.observe(liquid_block<float>({0.01, 0, 0.004}));
  const auto seen_right = std::array{right.predict(fluid)}, seen_wrong = std::array{wrong.predict(fluid)};
  const auto nothing = observation({}), perfect = observation(seen_right), other = observation(seen_wrong);
  const double anywhere = std::numeric_limits<double>::infinity();
  const auto require_laws = [&](const auto& corrector, double still) {
    for (const auto& law :
         decant::testing::corrector_laws(corrector, fluid, nothing, perfect, other, 1.0f / 30, still)) {
      INFO(law.text());
      REQUIRE(law.holds());
    }
  };
  require_laws(decant::OpenLoop<>(), 0);
  require_laws(decant::TransportCorrector<>(), 1e-4);  // a tenth of a pixel
  require_laws(decant::MassRelocation<>(), 0);
  require_laws(decant::EdgeFit<>(), 0);
  require_laws(decant::MapFilter<>(), 0);
  require_laws(decant::SilhouetteCorrector<>(), 1e-4);
  require_laws(decant::MapFilterSchenck2017<>(), anywhere);  // as printed, they move what is right
  require_laws(decant::WarpFieldSchenck2017<>(), anywhere);
}

TEST_CASE("correctors: settings are checked") {
  decant::TransportCorrectorSettings transport;
  transport.passes.clear();
  CHECK_THROWS_WITH(decant::TransportCorrector<>(transport), decant_test::contains("passes must be at least one"));
  transport = {};
  transport.longest_move = std::nan("");
  CHECK_THROWS_WITH(decant::TransportCorrector<>(transport), decant_test::contains("longest_move [m] must be > 0"));
  CHECK_THROWS_WITH(decant::MapFilter<>({.cells = {0.005, 0}}), decant_test::contains("cells [m] must be > 0, got 0"));
  CHECK_THROWS_WITH(decant::MapFilter<>({.edge_px = 2, .reach_px = 1}),
                    decant_test::contains("reach_px must be > edge"));
  CHECK_THROWS_WITH(decant::MapFilterSchenck2017<>({.cell = 0}), decant_test::contains("cell [m] must be > 0"));
  CHECK_THROWS_WITH(decant::WarpFieldSchenck2017<>({.strength = -1}),
                    decant_test::contains("strength [1/s^2] must be"));
}
