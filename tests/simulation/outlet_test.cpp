// SPDX-License-Identifier: MIT
// An outlet takes out the integral of its flow to within one particle, from where it is asked to; what goes on from an
// exit falls freely.

#include <decant/simulation/outlet.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <numeric>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <decant/boundary/shapes.hpp>
#include <decant/core/domain.hpp>
#include <decant/simulation/simulator.hpp>

#include "catch.hpp"
#include "scene.hpp"

using namespace decant;

namespace {

constexpr double outlet_spacing = 0.006;  // [m]
constexpr double one_particle = outlet_spacing * outlet_spacing * outlet_spacing;
constexpr double everywhere = std::numeric_limits<double>::infinity();

using OutletFlow = std::vector<std::pair<double, double>>;

template <class Scalar>
FluidState<Scalar> still_block(int nx, int ny, int nz) {
  const auto x = decant_test::block<Scalar>(nx, ny, nz, outlet_spacing);
  FluidState<Scalar> fluid;
  fluid.resize(x.cols());
  fluid.position = x;
  for (Index i = 0; i < fluid.size(); ++i) {
    fluid.id[i] = static_cast<std::uint32_t>(i);
  }
  return fluid;
}

// Takes particles out as a simulator would, but leaves the others in another order. @return the ids of what went.
template <class Scalar, class Domain = OpenDomain>
std::vector<std::uint32_t> let_go(Outlet& outlet, double time, double time_step, FluidState<Scalar>& fluid,
                                  const Pose& pose = {}, const Domain& domain = {}) {
  std::vector<Outlet::Candidate> scratch;
  std::vector<Index> leaving;
  std::vector<std::uint32_t> ids;
  outlet.advance(time, time_step, pose, fluid, domain, scratch, [&](Index i) {
    leaving.push_back(i);
    ids.push_back(fluid.id[i]);
    return one_particle;
  });
  std::sort(leaving.rbegin(), leaving.rend());
  for (const Index i : leaving) {
    const Index last = fluid.size() - 1;
    fluid.position.col(i) = Vector3<Scalar>(fluid.position.col(last));
    fluid.id[i] = fluid.id[last];
    fluid.resize(last);
  }
  return ids;
}

// A flow that takes out `count` particles in one step of 1 s from t = 0, and a tenth of one more.
OutletFlow flow_of(int count) { return {{0, (count + 0.1) * one_particle}, {1, (count + 0.1) * one_particle}}; }

// An open box with a floor of 48 x 48 mm at z = 0 and liquid on it.
template <class Parts = DefaultParts<float>>
Simulator<Parts> box_to_drain(int layers, int threads = 1, const PoseTrack& motion = {}, double fixed_step = 0) {
  SimulatorSettings settings = decant_test::with_spacing(outlet_spacing, threads);
  settings.fixed_step = fixed_step;
  Simulator<Parts> simulator(settings);
  simulator.add_body("box", BoxInside{{0, 0, 0}, {0.048, 0.048, 0.12}, 0.002, Face::PositiveZ}, motion);
  auto x = decant_test::block<typename Parts::Scalar>(8, 8, layers, outlet_spacing);
  simulator.add_particles(x, PointArray<typename Parts::Scalar>::Zero(3, x.cols()), 5);
  return simulator;
}

OutletSettings hole_in_floor(OutletFlow flow) {
  OutletSettings hole;
  hole.body = 0;
  hole.position = {0.024, 0.024, 0};
  hole.radius = 0.015;
  hole.flow = std::move(flow);
  return hole;
}

template <class Parts>
std::vector<std::uint32_t> sorted_ids(const Simulator<Parts>& simulator) {
  const auto& id = simulator.fluid().id;
  std::vector<std::uint32_t> result(id.data(), id.data() + id.size());
  std::sort(result.begin(), result.end());
  return result;
}

// All bits of the particles, in their order in memory.
template <class Scalar>
std::vector<unsigned char> bits_of(const FluidState<Scalar>& fluid) {
  std::vector<unsigned char> bits;
  const auto write = [&](const auto& array) {
    const auto* bytes = reinterpret_cast<const unsigned char*>(array.data());
    bits.insert(bits.end(), bytes, bytes + static_cast<std::size_t>(array.size()) * sizeof(*array.data()));
  };
  write(fluid.position);
  write(fluid.velocity);
  write(fluid.density);
  write(fluid.pressure);
  write(fluid.id);
  return bits;
}

std::string outlet_refusal(const std::function<void()>& call) {
  try {
    call();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return {};
}

}  // namespace

TEST_CASE("outlet: flow is linear between entries and zero outside") {
  OutletSettings settings;
  settings.flow = {{1, 0}, {2, 4e-5}, {4, 2e-5}};
  const Outlet outlet(settings, outlet_spacing);
  CHECK(outlet.flow(0.5) == 0);
  CHECK(outlet.flow(1.5) == Approx(2e-5));
  CHECK(outlet.flow(2) == Approx(4e-5));
  CHECK(outlet.flow(3) == Approx(3e-5));
  CHECK(outlet.flow(4.5) == 0);
  CHECK(Outlet({}, outlet_spacing).flow(0) == 0);
}

TEMPLATE_TEST_CASE("outlet: what went is the integral of the flow within one particle", "", float, double) {
  // rises over [0.1, 0.5], stands until 1.4, ends at 1.6; the integral by hand
  const double most = 4e-5;
  const auto integral = [&](double t) {
    const double rise = std::clamp(t, 0.1, 0.5) - 0.1, flat = std::clamp(t, 0.5, 1.4) - 0.5;
    const double fall = std::clamp(t, 1.4, 1.6) - 1.4;
    return most * (rise * rise / 0.8 + flat + fall - fall * fall / 0.4);
  };
  for (const double step : {0.0007, 0.003, 0.02, 0.37, 5.0}) {
    OutletSettings settings;
    settings.radius = everywhere;
    settings.flow = {{0.1, 0}, {0.5, most}, {1.4, most}, {1.6, 0}};
    Outlet outlet(settings, outlet_spacing);
    auto fluid = still_block<TestType>(8, 8, 8);
    std::size_t gone = 0;
    for (double t = 0; t < 2; t += step) {
      gone += let_go(outlet, t, step, fluid).size();
      const double asked = integral(t + step);
      INFO("step " << step << " at " << t + step);
      REQUIRE(static_cast<double>(gone) * one_particle <= asked * (1 + 1e-12));
      REQUIRE(static_cast<double>(gone) * one_particle > asked - one_particle * (1 + 1e-9));
    }
    CHECK(gone == static_cast<std::size_t>(most * 1.2 / one_particle));  // 222.2
  }
}

TEMPLATE_TEST_CASE("outlet: the nearest particles within the radius go first, by id where several are as near", "",
                   float, double) {
  const bool turned = GENERATE(false, true);
  const Pose pose =
      turned ? Pose{Eigen::Quaterniond(Eigen::AngleAxisd(2.0, Vector3<double>(1, 2, 2) / 3)), {0.2, 0, 0}} : Pose{};
  const Vector3<double> center(0.024, 0.03, 0.024);  // amid eight particles: all are as far as several others
  OutletSettings settings;
  settings.position = pose.inverse() * center;
  settings.radius = 0.0141;
  settings.flow = flow_of(40);
  auto fluid = still_block<TestType>(8, 10, 8);
  for (Index i = 0; i < fluid.size(); ++i) {
    fluid.position.col(i) = (fluid.position.col(i).array() * 1024).round() / 1024;  // exact, so that ties are
  }
  const auto kept = fluid;
  const Vector3<TestType> seen = (pose * settings.position).template cast<TestType>();
  const auto distance_squared = [&](std::uint32_t i) {
    return Vector3<TestType>(kept.position.col(i) - seen).template cast<double>().squaredNorm();
  };
  std::vector<std::uint32_t> order(static_cast<std::size_t>(fluid.size()));
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    const double to_a = distance_squared(a), to_b = distance_squared(b);
    return to_a != to_b ? to_a < to_b : a < b;
  });

  // one by one, from memory that changes its order each time
  Outlet slow(settings, outlet_spacing);
  std::vector<std::uint32_t> gone;
  for (int k = 0; k < 100; ++k) {
    const auto next = let_go(slow, 0.01 * k, 0.01, fluid, pose);
    REQUIRE(next.size() <= 1);
    gone.insert(gone.end(), next.begin(), next.end());
  }
  REQUIRE(gone.size() == 40);
  CHECK(std::equal(gone.begin(), gone.end(), order.begin()));

  Outlet at_once(settings, outlet_spacing);
  fluid = kept;
  CHECK(let_go(at_once, 0, 1, fluid, pose) == gone);

  // no more than is near enough, however much is asked for
  settings.flow = flow_of(500);
  Outlet greedy(settings, outlet_spacing);
  fluid = kept;
  const auto near = static_cast<std::size_t>(std::count_if(order.begin(), order.end(), [&](std::uint32_t i) {
    return distance_squared(i) <= settings.radius * settings.radius;
  }));
  REQUIRE(near > 40);
  CHECK(let_go(greedy, 0, 1, fluid, pose).size() == near);
}

TEST_CASE("outlet: distances are those of the domain") {
  const PeriodicDomain<double> ring({0.048, 0, 0});
  OutletSettings settings;
  settings.position = {0.001, 0.003, 0.003};
  settings.radius = 0.0055;  // reaches the first and, across the border, the last of a row
  settings.flow = flow_of(8);
  Outlet outlet(settings, outlet_spacing);
  auto fluid = still_block<double>(8, 1, 1);
  CHECK(let_go(outlet, 0, 1, fluid, {}, ring) == std::vector<std::uint32_t>{0, 7});
}

TEST_CASE("outlet: evenly means that every particle within the radius is as likely to go") {
  OutletSettings settings;
  settings.order = OutletOrder::Evenly;
  settings.radius = everywhere;
  settings.flow = flow_of(480);
  const int side = 12, all = side * side * side, taken = 480;
  const double half = 0.5 * side * outlet_spacing;
  Outlet outlet(settings, outlet_spacing);
  auto fluid = still_block<float>(side, side, side);
  const auto kept = fluid;
  std::array<int, 8> octants{}, shells{};
  int gone = 0;
  for (int k = 0; k < 100; ++k) {
    for (const std::uint32_t id : let_go(outlet, 0.01 * k, 0.01, fluid)) {
      const Vector3<double> x = kept.position.col(id).cast<double>().array() - half;
      ++octants[static_cast<std::size_t>((x[0] > 0) + 2 * (x[1] > 0) + 4 * (x[2] > 0))];
      // cubic shells around the middle: a "nearest" in disguise would empty the inner ones
      ++shells[static_cast<std::size_t>(x.cwiseAbs().maxCoeff() / outlet_spacing)];
      ++gone;
    }
  }
  REQUIRE(gone == taken);
  const double left = double(all - taken) / (all - 1);  // drawn without putting back: counts vary less
  double chi_squared = 0;
  for (const int count : octants) {
    chi_squared += (count - taken / 8.0) * (count - taken / 8.0) / (taken / 8.0) / left;
  }
  CHECK(chi_squared < 24.3);  // 7 degrees of freedom: one draw in a thousand is above, one below 0.6
  CHECK(chi_squared > 0.6);
  chi_squared = 0;
  for (int k = 0; k < side / 2; ++k) {
    const double share = (std::pow(k + 1, 3) - std::pow(k, 3)) / std::pow(side / 2, 3), expected = taken * share;
    chi_squared += std::pow(shells[static_cast<std::size_t>(k)] - expected, 2) / expected / left;
  }
  CHECK(chi_squared < 20.5);  // 5 degrees of freedom

  // only within the radius, and from the middle of it as well as from its rim
  settings.position = {half, half, half};
  settings.radius = 0.5 * half;
  settings.flow = flow_of(50);
  Outlet ball(settings, outlet_spacing);
  fluid = kept;
  int inner = 0;
  for (const std::uint32_t id : let_go(ball, 0, 1, fluid)) {
    const double distance = (kept.position.col(id).cast<double>().array() - half).matrix().norm();
    CHECK(distance <= settings.radius);
    inner += distance < settings.radius * std::cbrt(0.5) ? 1 : 0;
  }
  CHECK(std::abs(inner - 25) < 4 * std::sqrt(12.5));
}

TEST_CASE("outlet: evenly has no memory: what came in last is as likely to go") {
  OutletSettings settings;
  settings.order = OutletOrder::Evenly;
  settings.radius = everywhere;
  settings.flow = {{0, 200 * one_particle}, {3, 200 * one_particle}};
  Outlet outlet(settings, outlet_spacing);
  auto fluid = still_block<float>(10, 10, 20);
  for (int k = 0; k < 100; ++k) {
    let_go(outlet, 0.01 * k, 0.01, fluid);
  }
  const Index old = fluid.size();
  REQUIRE(old >= 1800);
  fluid.resize(old + 2000);
  for (Index i = old; i < fluid.size(); ++i) {
    fluid.id[i] = static_cast<std::uint32_t>(2000 + i - old);
  }
  int of_new = 0, of_all = 0;
  for (int k = 100; k < 300; ++k) {
    for (const std::uint32_t id : let_go(outlet, 0.01 * k, 0.01, fluid)) {
      of_new += id >= 2000 ? 1 : 0;
      ++of_all;
    }
  }
  CHECK(of_all >= 399);
  const double share = 2000.0 / 3800;
  CHECK(std::abs(of_new - share * of_all) < 3 * std::sqrt(share * (1 - share) * of_all));
}

TEST_CASE("outlet: where there was no liquid, one particle is made up for at most") {
  OutletSettings settings;
  settings.radius = 0.02;
  settings.flow = {{0, 100 * one_particle}, {2, 100 * one_particle}};
  Outlet outlet(settings, outlet_spacing);
  FluidState<float> none;
  for (int k = 0; k < 100; ++k) {
    CHECK(let_go(outlet, 0.01 * k, 0.01, none).empty());
  }
  auto late = still_block<float>(3, 3, 3);
  CHECK(let_go(outlet, 1, 0.001, late).size() == 1);
  CHECK(let_go(outlet, 1.001, 0.008, late).empty());
  CHECK(let_go(outlet, 1.009, 0.002, late).size() == 1);
  // an outlet that has closed while it was dry takes nothing any more
  for (int k = 102; k < 220; ++k) {
    let_go(outlet, 0.01 * k, 0.01, none);
  }
  CHECK(let_go(outlet, 2.2, 1, late).empty());
  // no way out counts as no liquid
  Outlet blocked(settings, outlet_spacing);
  std::vector<Outlet::Candidate> scratch;
  int asked = 0;
  for (int k = 0; k < 100; ++k) {
    blocked.advance(0.01 * k, 0.01, Pose{}, late, OpenDomain{}, scratch, [&](Index) {
      ++asked;
      return 0.0;
    });
  }
  CHECK(asked >= 99);
  CHECK(asked <= 100);
  CHECK(let_go(blocked, 1, 0.001, late).size() == 1);
}

TEST_CASE("outlet: with an exit only what is on the opening's side goes out") {
  OutletSettings settings;
  settings.position = {0.024, 0.024, 0.03};
  settings.radius = everywhere;
  settings.exit = {0.024, 0.024, 0.018};  // half-way is at 0.024, between layers of the block
  settings.flow = flow_of(1000);
  Outlet outlet(settings, outlet_spacing);
  auto fluid = still_block<float>(8, 8, 8);
  CHECK(let_go(outlet, 0, 1, fluid).size() == 256);
  CHECK(fluid.position.row(2).maxCoeff() < 0.024f);
  const Pose pose{Eigen::Quaterniond(Eigen::AngleAxisd(2.0, Vector3<double>(1, 2, 2) / 3)), {0.2, 0, 0}};
  OutletSettings in_body = settings;
  in_body.position = pose.inverse() * settings.position;
  in_body.exit = pose.inverse() * *settings.exit;
  Outlet turned(in_body, outlet_spacing);
  fluid = still_block<float>(8, 8, 8);
  CHECK(let_go(turned, 0, 1, fluid, pose).size() == 256);
  CHECK(fluid.position.row(2).maxCoeff() < 0.024f);
  // places: a disc across the way out, one spacing apart, nearest first
  const auto& places = outlet.places();
  REQUIRE(places.size() == 29);
  CHECK(places[0] == *settings.exit);
  double farthest = 0;
  for (std::size_t a = 0; a < places.size(); ++a) {
    const double distance = (places[a] - places[0]).norm();
    CHECK(distance >= farthest - 1e-12);
    CHECK(distance < 3 * outlet_spacing + 1e-12);
    CHECK(places[a].z() == Approx(0.018));
    farthest = std::max(farthest, distance);
    for (std::size_t b = 0; b < a; ++b) {
      CHECK((places[a] - places[b]).norm() > outlet_spacing - 1e-12);
    }
  }
  CHECK(outlet.exit_speed(0.5) == 0);
  settings.exit_velocity = {0, 3, -4};
  CHECK(Outlet(settings, outlet_spacing).exit_speed(0.5) == Approx(5));
  CHECK(Outlet(settings, outlet_spacing).exit_speed(1.5) == 0);
  settings.exit.reset();
  CHECK(Outlet(settings, outlet_spacing).exit_speed(0.5) == 0);
  CHECK(Outlet(settings, outlet_spacing).places().empty());
}

TEMPLATE_TEST_CASE("outlet: a box with a hole drains at the flow that is asked for, and its level falls by as much", "",
                   DefaultParts<float>, DefaultParts<double>, PositionBasedParts<float>) {
  const double rate = 1e-4, area = 0.048 * 0.048;  // [m^3/s], [m^2]
  auto simulator = box_to_drain<TestType>(10);
  auto outlet = hole_in_floor({{0.1, rate}, {0.7, rate}});
  if (GENERATE(false, true)) {
    outlet.order = OutletOrder::Evenly;
    outlet.radius = everywhere;
  }
  simulator.add_outlet(outlet);
  const double before = 640 * one_particle;
  for (int k = 1; k <= 40; ++k) {
    const StepReport report = simulator.step(0.02);
    REQUIRE(report.advanced());
    const double asked = rate * std::clamp(0.02 * k - 0.1, 0.0, 0.6);
    INFO("at " << 0.02 * k << " s");
    REQUIRE(report.drained <= asked * (1 + 1e-6));
    REQUIRE(report.drained > asked - one_particle * (1 + 1e-6));
    REQUIRE(report.volume + report.drained == Approx(before).epsilon(1e-6));
    REQUIRE(report.particles == simulator.fluid().size());
    REQUIRE(report.lost == 0);
    // the surface stands at twice the mean height of liquid that fills the box below it
    const double level = 2 * static_cast<double>(simulator.fluid().position.row(2).mean());
    CHECK(std::abs(level - (before - report.drained) / area) < 0.5 * outlet_spacing);
    // nothing that fills the gaps is faster than what falls from the surface
    CHECK(simulator.fluid().velocity.colwise().norm().maxCoeff() < std::sqrt(2 * 9.81 * before / area));
  }
}

TEST_CASE("outlet: one that moves with its body drains it wherever it is") {
  // a cup that is carried by half a metre per second, and one that rocks; a hole fixed in the world would soon be dry
  std::vector<PoseTrack> motions{PoseTrack({{0, Pose{}}, {1, Pose{Eigen::Quaterniond::Identity(), {0.5, 0, 0}}}}),
                                 decant_test::rocking(1, 9, 0.02, 12)};
  for (const PoseTrack& motion : motions) {
    auto simulator = box_to_drain(6, 1, motion);
    auto hole = hole_in_floor({{0, 5e-5}, {2, 5e-5}});
    hole.exit = {0.024, 0.024, -0.006};
    hole.exit_velocity = {0, 0, -0.2};
    simulator.add_outlet(hole);
    Index outside = 0;
    StepReport report;
    for (int k = 1; k <= 50; ++k) {
      std::set<std::uint32_t> inside;
      const auto x_in_body = [&](Index i) {
        return simulator.bodies()[0].motion.at(simulator.time()).inverse() *
               Vector3<double>(simulator.fluid().position.col(i).cast<double>());
      };
      for (Index i = 0; i < simulator.fluid().size(); ++i) {
        if (x_in_body(i).z() > 0) {
          inside.insert(simulator.fluid().id[i]);
        }
      }
      report = simulator.step(0.02);
      REQUIRE(report.advanced());
      REQUIRE(report.lost == 0);
      outside = 0;
      for (Index i = 0; i < simulator.fluid().size(); ++i) {
        const Vector3<double> x = x_in_body(i);
        const bool in = (x.array() > 0).all() && x.x() < 0.048 && x.y() < 0.048;
        outside += in ? 0 : 1;
        if (!in && inside.count(simulator.fluid().id[i]) > 0) {
          // it has fallen for at most 20 ms, which takes it 6 mm and the body's acceleration a millimetre or two aside
          REQUIRE(std::hypot(x.x() - 0.024, x.y() - 0.024) < 2 * outlet_spacing);
          REQUIRE(x.z() < -0.005);
          REQUIRE(x.z() > -0.018);
        }
      }
    }
    CHECK(report.drained == Approx(static_cast<double>(outside) * one_particle).epsilon(1e-6));
    CHECK(report.drained > 5e-5 - 2 * one_particle);
    CHECK(report.particles == 384);
  }
}

TEMPLATE_TEST_CASE("outlet: what goes on from an exit is the same liquid, and falls freely", "", DefaultParts<float>,
                   DefaultParts<double>, StateEquationParts<float>) {
  struct Jet {
    double rate, start;  // [m^3/s], [m/s]
  };
  // particles one by one, out of each other's reach, and two jets for which several have to start side by side
  const Jet jet = GENERATE(Jet{5e-6, 0.3}, Jet{4e-5, 0.3}, Jet{4e-5, 0});
  const bool one_by_one = jet.rate < 1e-5;
  auto simulator = box_to_drain<TestType>(6);
  auto hole = hole_in_floor({{0, jet.rate}, {1, jet.rate}});
  hole.exit = {0.024, 0.024, -0.006};
  hole.exit_velocity = {0, 0, -jet.start};
  simulator.add_outlet(hole);
  const auto ids = sorted_ids(simulator);
  const double g = 9.81, longest_step = simulator.settings().largest_step;
  for (int k = 1; k <= 20; ++k) {
    const StepReport report = simulator.step(0.02);
    const double asked = jet.rate * 0.02 * k;
    REQUIRE(report.advanced());
    REQUIRE(report.drained <= asked * (1 + 1e-6));
    REQUIRE(report.drained > asked - one_particle * (1 + 1e-6));
    REQUIRE(report.particles == 384);
    REQUIRE(report.volume == Approx(384 * one_particle).epsilon(1e-6));
    REQUIRE(report.density_error < 6e-3);  // the state equation's own weight makes 4e-3 of that
    REQUIRE(sorted_ids(simulator) == ids);
    const auto& fluid = simulator.fluid();
    Index below = 0;
    for (Index i = 0; i < fluid.size(); ++i) {
      const Vector3<double> x = fluid.position.col(i).template cast<double>();
      const Vector3<double> v = fluid.velocity.col(i).template cast<double>();
      REQUIRE(fluid.origin[i] == 5);
      if (x.z() > 0) {
        REQUIRE(v.norm() < std::sqrt(2 * g * 6 * outlet_spacing));  // as if fallen from the surface
        continue;
      }
      ++below;
      // Symplectic Euler is ahead: v^2 - v0^2 - 2 g s = -g dt (v - v0). Where particles are in each other's reach they
      // push and pull, by what falling through one spacing would do at most.
      const double gained = v.z() * v.z() - jet.start * jet.start - 2 * g * (-0.006 - x.z());
      const double slack = one_by_one ? 1e-4 : 2 * g * outlet_spacing;
      REQUIRE(gained < slack);
      REQUIRE(gained > -g * longest_step * -v.z() - slack);
      // as for a tenth of a spacing of height, sqrt(2 g d / 10) = 0.11 m/s, where they push each other aside
      REQUIRE(std::hypot(v.x(), v.y()) < (one_by_one ? 1e-4 : 0.1));
      for (Index j = 0; j < i; ++j) {
        if (fluid.position(2, j) < 0) {
          REQUIRE((fluid.position.col(i) - fluid.position.col(j)).norm() > 0.8 * outlet_spacing);
        }
      }
    }
    REQUIRE(static_cast<double>(below) * one_particle == Approx(report.drained).epsilon(1e-6).margin(1e-12));
  }
}

namespace {

// A box that stands or moves as told, without gravity; liquid is put where the test wants it. One step is 1 ms.
LiquidSimulator weightless_box(const PoseTrack& motion, double wall, const std::vector<Vector3<double>>& places) {
  SimulatorSettings settings = decant_test::with_spacing(outlet_spacing);
  settings.gravity.setZero();
  settings.fixed_step = 0.001;
  LiquidSimulator simulator(settings);
  simulator.add_body("box", BoxInside{{0, 0, 0}, {0.048, 0.048, 0.12}, wall, Face::PositiveZ}, motion);
  PointArray<float> x(3, static_cast<Index>(places.size()));
  for (std::size_t k = 0; k < places.size(); ++k) {
    x.col(static_cast<Index>(k)) = (motion.at(0) * places[k]).cast<float>();
  }
  simulator.add_particles(x, PointArray<float>::Zero(3, x.cols()), 0);
  return simulator;
}

}  // namespace

TEST_CASE("outlet: exit and its velocity are in the body's frame, and the body's own motion comes on top") {
  const Vector3<double> axis = Vector3<double>(2, -1, 2) / 3, shift(0.3, 0.1, -0.2);  // [m/s]
  const double rate = 2;                                                              // [rad/s]
  const auto pose = [&](double t) {
    return Pose{Eigen::Quaterniond(Eigen::AngleAxisd(1 + rate * t, axis)), Vector3<double>(0.1, 0.2, 0.3) + t * shift};
  };
  const PoseTrack motion({{0, pose(0)}, {0.1, pose(0.1)}});
  auto simulator = weightless_box(motion, 0.002, {{0.024, 0.024, 0.003}});
  auto hole = hole_in_floor({{0, 1100 * one_particle}, {0.001, 1100 * one_particle}});  // in the first step
  hole.exit = {0.02, 0.03, -0.02};
  hole.exit_velocity = {0.2, -0.1, -0.4};
  simulator.add_outlet(hole);
  const StepReport report = simulator.step(0.001);
  REQUIRE(report.sub_steps == 1);
  REQUIRE(report.particles == 1);
  CHECK(report.drained == Approx(one_particle));
  const Vector3<double> from = pose(0) * *hole.exit;
  const Vector3<double> expected =
      pose(0).rotation * hole.exit_velocity + shift + rate * axis.cross(from - pose(0).translation);
  const Vector3<double> v = simulator.fluid().velocity.col(0).cast<double>();
  CHECK((v - expected).norm() < 1e-4);  // rounding of floats: the box's speed is a difference of places over 1 ms
  CHECK((simulator.fluid().position.col(0).cast<double>() - from - 0.001 * v).norm() < 1e-7);
}

TEST_CASE("outlet: an exit is among bodies as they stand when liquid goes out") {
  // 5 mm a step: where the box was a step before, its floor is where the exit is now
  const PoseTrack motion({{0, Pose{}}, {1, Pose{Eigen::Quaterniond::Identity(), {0, 0, 5}}}});
  auto simulator = weightless_box(motion, 0.002, {{0.024, 0.024, 0.003}});
  auto hole = hole_in_floor({{0.003, 1100 * one_particle}, {0.004, 1100 * one_particle}});
  hole.exit = {0.024, 0.024, -0.006};
  simulator.add_outlet(hole);
  REQUIRE(simulator.step(0.003).drained == 0);
  REQUIRE(simulator.step(0.001).drained == Approx(one_particle));
  const Vector3<double> expected = motion.at(0.004) * *hole.exit;  // it goes along with the box
  CHECK((simulator.fluid().position.col(0).cast<double>() - expected).norm() < 1e-6);
}

TEST_CASE("outlet: liquid behind the wall does not take the room at the exit") {
  auto simulator = weightless_box({}, 0.0005, {{0.024, 0.024, 0.001}, {0.024, 0.024, 0.03}});
  auto hole = hole_in_floor({{0, 1100 * one_particle}, {0.001, 1100 * one_particle}});
  hole.radius = everywhere;
  hole.position.z() = 0.028;  // the upper one goes
  hole.exit = {0.024, 0.024, -0.0037};
  simulator.add_outlet(hole);
  REQUIRE(simulator.step(0.001).drained > 0);
  const auto& x = simulator.fluid().position;
  const Index out = x(2, 0) < 0 ? 0 : 1;
  CHECK((x.col(out).cast<double>() - *hole.exit).norm() < 1e-6);
}

TEST_CASE("outlet: what finds no place a spacing off the others waits") {
  std::vector<Vector3<double>> places;
  for (Index k = 0; k < 64; ++k) {
    places.emplace_back(decant_test::block<double>(4, 4, 4, outlet_spacing, {0.012, 0.012, 0}).col(k));
  }
  auto simulator = weightless_box({}, 0.002, places);
  auto hole = hole_in_floor({{0, 50000 * one_particle}, {1, 50000 * one_particle}});
  hole.radius = everywhere;
  hole.exit = {0.024, 0.024, -0.008};
  simulator.add_outlet(hole);
  const StepReport report = simulator.step(0.001);
  CHECK(report.drained == Approx(29 * one_particle));
  CHECK(report.particles == 64);
  const auto& x = simulator.fluid().position;
  for (Index i = 0; i < 64; ++i) {
    for (Index j = 0; j < i; ++j) {
      CHECK((x.col(i) - x.col(j)).norm() > 0.98 * outlet_spacing);
    }
  }
  // the disc is full of liquid at rest
  CHECK(simulator.step(0.002).drained == report.drained);
}

TEST_CASE("outlet: an exit puts nothing into material nor on top of other liquid") {
  auto simulator = box_to_drain(8);
  // a closed vessel around the exit, for 3 x 3 x 4 particles
  simulator.add_body("flask", BoxInside{{0.015, 0.015, -0.028}, {0.033, 0.033, -0.004}, 0.001, {}});
  auto hole = hole_in_floor({{0, 2e-4}, {1, 2e-4}});
  hole.exit = {0.016, 0.024, -0.006};  // next to its wall
  simulator.add_outlet(hole);
  StepReport report;
  double fastest = 0;
  for (int k = 0; k < 50; ++k) {
    report = simulator.step(0.02);
    REQUIRE(report.advanced());
    REQUIRE(report.lost == 0);
    REQUIRE(report.particles == 512);
    Index below = 0;
    for (Index i = 0; i < simulator.fluid().size(); ++i) {
      const Vector3<double> x = simulator.fluid().position.col(i).cast<double>();
      if (x.z() < 0) {
        ++below;
        REQUIRE((x.head<2>().array() > 0.015).all());
        REQUIRE((x.head<2>().array() < 0.033).all());
        REQUIRE(x.z() < -0.004);
        REQUIRE(x.z() > -0.028);
      }
      fastest = std::max(fastest, static_cast<double>(simulator.fluid().velocity.col(i).norm()));
    }
    REQUIRE(report.drained == Approx(static_cast<double>(below) * one_particle).epsilon(1e-6).margin(1e-12));
  }
  CHECK(report.drained > 0.6 * 36 * one_particle);  // its liquid need not be on a lattice
  CHECK(report.drained <= 36 * one_particle * (1 + 1e-6));
  CHECK(fastest < 0.7);  // falling through its 24 mm
}

TEST_CASE("outlet: nothing goes where a body stands at the exit") {
  auto simulator = box_to_drain(4);
  auto hole = hole_in_floor({{0, 5e-5}, {1, 5e-5}});
  hole.exit = {0.024, 0.024, -0.012};
  simulator.add_outlet(hole);
  simulator.add_body("table", Box{{-0.1, -0.1, -0.05}, {0.1, 0.1, -0.005}},
                     PoseTrack({{0.2, Pose{}}, {0.3, Pose{Eigen::Quaterniond::Identity(), {0, 0, -0.1}}}}));
  for (int k = 0; k < 10; ++k) {
    const StepReport report = simulator.step(0.02);
    REQUIRE(report.advanced());
    REQUIRE(report.drained == 0);
    REQUIRE(report.particles == 256);
    REQUIRE(simulator.fluid().position.row(2).minCoeff() > 0);
  }
  // and it opens once that has gone, without a gulp
  REQUIRE(simulator.step(0.1).advanced());
  const StepReport report = simulator.step(0.1);
  CHECK(report.drained > 5e-5 * 0.1);
  CHECK(report.drained < 5e-5 * 0.2 + one_particle);
}

TEST_CASE("outlet: several take their own share, beside an inlet") {
  auto simulator = box_to_drain(4);
  InletSettings tap;
  tap.position = {0.024, 0.024, 0.1};
  tap.radius = 0.004;  // one place
  tap.flow = {{0, 2e-5}, {1, 2e-5}};
  simulator.add_inlet(tap, 9);
  auto hole = hole_in_floor({{0, 1e-5}, {1, 1e-5}});
  simulator.add_outlet(hole);
  OutletSettings air;
  air.radius = everywhere;
  air.order = OutletOrder::Evenly;
  air.flow = {{0.5, 1e-5}, {1, 1e-5}};
  simulator.add_outlet(air);
  StepReport report;
  for (int k = 0; k < 50; ++k) {
    report = simulator.step(0.02);
    REQUIRE(report.advanced());
  }
  CHECK(report.drained <= 1.5e-5);
  CHECK(report.drained > 1.5e-5 - 2 * one_particle);
  CHECK(report.volume + report.drained == Approx(256 * one_particle + 2e-5).margin(one_particle));
  CHECK(report.lost == 0);
}

namespace {

// A hole with an exit and liquid that vanishes anywhere.
template <class Parts = DefaultParts<float>>
Simulator<Parts> leaking_box(int threads = 1, int layers = 8, double fixed_step = 0) {
  auto simulator = box_to_drain<Parts>(layers, threads, decant_test::rocking(1, 9, 0.01, 12), fixed_step);
  auto hole = hole_in_floor({{0, 4e-5}, {1, 4e-5}});
  hole.exit = {0.024, 0.024, -0.006};
  hole.exit_velocity = {0, 0, -0.1};
  simulator.add_outlet(hole);
  OutletSettings air;
  air.radius = everywhere;
  air.order = OutletOrder::Evenly;
  air.flow = {{0, 5e-5}, {1, 5e-5}};
  simulator.add_outlet(air);
  return simulator;
}

template <class Parts>
StepReport frames_of(Simulator<Parts>& simulator, int count) {
  StepReport report;
  for (int k = 0; k < count; ++k) {
    report = simulator.step(0.011);
    REQUIRE(report.advanced());
  }
  return report;
}

}  // namespace

TEMPLATE_TEST_CASE("outlet: the same bits with 1 and 2 threads", "", float, double) {
  static_assert(8 * 8 * 18 >= 2 * least_per_thread + 64);
  auto one = leaking_box<DefaultParts<TestType>>(1, 18);
  auto two = leaking_box<DefaultParts<TestType>>(2, 18);
  const StepReport expected = frames_of(one, 6);
  CHECK(expected.drained > 20 * one_particle);
  CHECK(frames_of(two, 6).drained == expected.drained);
  CHECK((bits_of(two.fluid()) == bits_of(one.fluid())));
}

TEMPLATE_TEST_CASE("outlet: a run that is restored from a snapshot continues bit for bit", "", float, double) {
  auto simulator = leaking_box<DefaultParts<TestType>>();
  frames_of(simulator, 5);
  const auto kept = simulator.snapshot();
  const StepReport report = frames_of(simulator, 10);
  const auto expected = bits_of(simulator.fluid());
  simulator.restore(kept);
  CHECK(frames_of(simulator, 10).drained == report.drained);
  CHECK((bits_of(simulator.fluid()) == expected));
  // outlets come with the snapshot
  Simulator<DefaultParts<TestType>> other(decant_test::with_spacing(outlet_spacing));
  other.restore(kept);
  CHECK(frames_of(other, 10).drained == report.drained);
  CHECK((bits_of(other.fluid()) == expected));
}

TEST_CASE("outlet: a frame that fails takes nothing out") {
  // with steps of given length what is not finite shows at the end of the frame only, after liquid has gone out
  const auto make = [] {
    auto simulator = leaking_box(1, 6, 0.002);
    const PointArray<float> far = PointArray<float>::Constant(3, 1, 1);
    simulator.add_particles(far, PointArray<float>::Zero(3, 1), 0);
    return simulator;
  };
  auto simulator = make(), untroubled = make();
  frames_of(simulator, 5);
  const StepReport before = frames_of(untroubled, 5);
  auto& fluid = simulator.fluid();
  const auto spare = std::find(fluid.id.data(), fluid.id.data() + fluid.size(), 384u) - fluid.id.data();
  REQUIRE(spare < fluid.size());
  const float speed = fluid.velocity(0, spare);
  fluid.velocity(0, spare) = std::numeric_limits<float>::quiet_NaN();
  for (int k = 0; k < 3; ++k) {
    const StepReport failed = simulator.step(0.017);
    CHECK(failed.status == StepStatus::NonFinite);
    CHECK(failed.sub_steps > 5);
    CHECK(failed.drained == before.drained);
    CHECK(failed.particles == before.particles);
  }
  fluid.velocity(0, spare) = speed;
  CHECK((bits_of(fluid) == bits_of(untroubled.fluid())));
  CHECK(frames_of(simulator, 10).drained == frames_of(untroubled, 10).drained);
  CHECK((bits_of(fluid) == bits_of(untroubled.fluid())));
}

TEST_CASE("outlet: settling does not drain") {
  auto simulator = leaking_box();
  frames_of(simulator, 2);
  auto copy = simulator;
  const double drained = simulator.step(0).drained;
  const Index count = simulator.fluid().size();
  REQUIRE(drained > 0);
  const StepReport settled = simulator.settle(0.3);
  CHECK(settled.advanced());
  CHECK(settled.drained == drained);
  CHECK(simulator.fluid().size() == count);
  // and then it goes on where it was: as much has gone as without
  CHECK(frames_of(simulator, 5).drained == frames_of(copy, 5).drained);
}

TEST_CASE("outlet: settings out of range are refused in one line") {
  auto simulator = box_to_drain(2);
  const double bad = std::numeric_limits<double>::quiet_NaN();
  const auto with = [](const std::function<void(OutletSettings&)>& change) {
    auto settings = hole_in_floor({{0, 1e-5}, {1, 1e-5}});
    settings.exit = {0.024, 0.024, -0.006};
    change(settings);
    return settings;
  };
  const std::vector<std::pair<std::string, OutletSettings>> wrong{
      {"Outlet: body must be one that was added, got 1", with([](OutletSettings& s) { s.body = 1; })},
      {"Outlet: position [m] must be finite", with([&](OutletSettings& s) { s.position.x() = bad; })},
      {"Outlet: position [m] must be finite", with([&](OutletSettings& s) { s.position.y() = everywhere; })},
      {"Outlet: radius [m] must be > 0, got 0", with([](OutletSettings& s) { s.radius = 0; })},
      {"Outlet: radius [m] must be > 0, got -1", with([](OutletSettings& s) { s.radius = -1; })},
      {"Outlet: radius [m] must be > 0, got", with([&](OutletSettings& s) { s.radius = bad; })},
      {"Outlet: flow [m^3/s] must be >= 0 and finite, got -1e-05", with([](OutletSettings& s) {
         s.flow = {{0, -1e-5}};
       })},
      {"Outlet: flow [m^3/s] must be >= 0 and finite", with([&](OutletSettings& s) {
         s.flow = {{0, bad}};
       })},
      {"Outlet: time [s] of the flow must be finite and increasing, got 0", with([](OutletSettings& s) {
         s.flow = {{1, 1e-5}, {0, 1e-5}};
       })},
      {"Outlet: time [s] of the flow must be finite and increasing", with([&](OutletSettings& s) {
         s.flow = {{bad, 1e-5}};
       })},
      {"Outlet: exit [m] must be finite and at least half a spacing off the position",
       with([](OutletSettings& s) { s.exit = s.position + Vector3<double>(0, 0, -0.0029); })},
      {"Outlet: exit [m] must be finite", with([&](OutletSettings& s) { s.exit->z() = bad; })},
      {"Outlet: exit [m] must be finite", with([&](OutletSettings& s) { s.exit->z() = -everywhere; })},
      {"Outlet: exit [m] must be outside of its body's material, got", with([](OutletSettings& s) {
         s.exit = {0.049, 0.02, 0.02};
       })},
      {"Outlet: exit_velocity [m/s] must be finite", with([&](OutletSettings& s) { s.exit_velocity.z() = bad; })},
  };
  for (const auto& [line, settings] : wrong) {
    const std::string said = outlet_refusal([&, &settings = settings] { simulator.add_outlet(settings); });
    INFO(said);
    CHECK(said.find(line) == 0);
    CHECK(said.find('\n') == std::string::npos);
  }
  // none was added
  CHECK(simulator.step(0.1).drained == 0);
  CHECK(outlet_refusal([&] { simulator.add_outlet(with([](OutletSettings& s) { s.radius = everywhere; })); }).empty());
}

TEST_CASE("outlet: flows and speeds beyond reason end in a report, not in NaN") {
  auto simulator = box_to_drain(2);
  OutletSettings all;
  all.radius = everywhere;
  all.flow = {{0, 1e308}, {1, 1e308}};
  simulator.add_outlet(all);
  StepReport report = simulator.step(0.02);
  CHECK(report.advanced());
  CHECK(report.particles == 0);
  CHECK(report.drained == Approx(128 * one_particle).epsilon(1e-6));
  auto jet = hole_in_floor({{0, 1e-5}, {1, 1e-5}});
  jet.exit = {0.024, 0.024, -0.006};
  jet.exit_velocity = {0, 0, -1e6};
  auto fast = box_to_drain(2);
  fast.add_outlet(jet);
  report = fast.step(0.02);
  CHECK(report.status == StepStatus::TooManySteps);
  CHECK(report.drained == 0);
  CHECK(fast.fluid().size() == 128);
}
