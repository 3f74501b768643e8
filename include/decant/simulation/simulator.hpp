// SPDX-License-Identifier: MIT
#pragma once

/// The simulator: liquid among rigid bodies, put together from parts at compile time and stepped frame by frame.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <decant/boundary/cavity.hpp>
#include <decant/boundary/concept.hpp>
#include <decant/boundary/mesh_report.hpp>
#include <decant/boundary/remembered_walls.hpp>
#include <decant/boundary/shielding.hpp>
#include <decant/boundary/wall_state.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/fluid_state.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/stopwatch.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/force/concept.hpp>
#include <decant/kernel/concept.hpp>
#include <decant/neighbor/concept.hpp>
#include <decant/neighbor/neighbor_list.hpp>
#include <decant/pressure/concept.hpp>
#include <decant/pressure/position_based.hpp>
#include <decant/simulation/inlet.hpp>
#include <decant/simulation/liquid.hpp>
#include <decant/simulation/outlet.hpp>
#include <decant/simulation/parts.hpp>
#include <decant/simulation/simulator_settings.hpp>
#include <decant/simulation/step_report.hpp>

namespace decant::inline DECANT_TARGET {

/// A liquid simulation composed of Parts (see simulation/parts.hpp). Holds no global state: any number of differently
/// composed simulators can live side by side. Not safe to call from several threads at once; copies are independent.
template <class Parts = DefaultParts<>>
class Simulator {
 public:
  using Scalar = typename Parts::Scalar;
  using Domain = typename Parts::Domain;
  using Kernel = typename Parts::Kernel;
  using Search = typename Parts::NeighborSearch;
  using Forces = typename Parts::Forces;
  using Solver = typename Parts::PressureSolver;
  using Bodies = typename Parts::Boundary;
  using Neighbors = NeighborList<Scalar, Domain>;
  using Step = StepView<Kernel, Neighbors>;

  static_assert(SmoothingKernel<Kernel>,
                "Parts::Kernel must model decant::SmoothingKernel, see <decant/kernel/concept.hpp>");
  static_assert(NeighborSearch<Search>,
                "Parts::NeighborSearch must model decant::NeighborSearch, see <decant/neighbor/concept.hpp>");
  static_assert(PressureSolver<Solver, Step>,
                "Parts::PressureSolver must model decant::PressureSolver, see <decant/pressure/concept.hpp>");
  static_assert(
      []<class... Terms>(std::type_identity<std::tuple<Terms...>>) {
        return (ForceTerm<Terms, Step> && ...);
      }(std::type_identity<Forces>{}),
      "every type in Parts::Forces must model decant::ForceTerm, see <decant/force/concept.hpp>");
  static_assert(Boundary<Bodies, Kernel>,
                "Parts::Boundary must model decant::Boundary, see <decant/boundary/concept.hpp>");

  /// Throws std::invalid_argument if a setting is out of range.
  explicit Simulator(const SimulatorSettings& settings = {}, const Domain& domain = {})
      : settings_(settings), domain_(domain), search_(domain), neighbors_(domain) {
    validate(settings_);
    smoothing_length_ = settings_.spacing * settings_.support_in_spacings / static_cast<double>(Kernel::support_factor);
    configure(solver_);
    std::apply([this](auto&... terms) { (this->configure(terms), ...); }, forces_);
  }

  // ---- the scene --------------------------------------------------------------------------------------------------

  /// Adds a rigid body; its wall integrals are prepared here, which takes time for meshes. Liquid that is where the
  /// body is put is pushed out of its material. Throws std::invalid_argument for a mesh that is empty, not finite or of
  /// the wrong size; flaws that it can live with are in bodies()[body].warnings, see also mesh_report.
  BodyId add_body(std::string name, BodyShape shape, PoseTrack motion = {}, Slip slip = Slip::Free) {
    const BodyId body = bodies_.template add<Kernel>(std::move(name), std::move(shape), std::move(motion), slip,
                                                     smoothing_length_, settings_.spacing, settings_.threads);
    bodies_.set_interval(time_, 0);
    bodies_.push_out(body, 0.5 * settings_.spacing, fluid_);
    return body;
  }

  /// Gives a body another shape where it is, as add_body does: for hypotheses that differ in one body, copies of a
  /// simulator share the walls of all others. Liquid that is in its material is pushed out. A container that was
  /// watched is so no longer.
  void replace_shape(BodyId body, BodyShape shape) requires requires(Bodies& bodies, Threads threads) {
    bodies.template replace_shape<Kernel>(body, std::move(shape), 1.0, 1.0, threads);
  }
  {
    expects(body < bodies_.size(), "Simulator: body", "one that was added", body);
    bodies_.template replace_shape<Kernel>(body, std::move(shape), smoothing_length_, settings_.spacing,
                                           settings_.threads);
    std::erase_if(watched_, [&](const Watched& watched) { return watched.first == body; });
    remembered_walls_.forget();
    bodies_.set_interval(time_, 0);
    bodies_.push_out(body, 0.5 * settings_.spacing, fluid_);
  }

  /// Looks a body's surface over as the body stands now, against gravity: its flaws in numbers and in words, and what
  /// fits below its rim. Takes some tenths of a second for a scan.
  MeshReport mesh_report(BodyId body) const {
    expects(body < bodies_.size(), "Simulator: body", "one that was added", body);
    const Vector3<double> up = settings_.gravity.norm() > 0 ? Vector3<double>(-settings_.gravity.normalized())
                                                            : Vector3<double>(Vector3<double>::UnitZ());
    return inspect(bodies_[body].shape->mesh, settings_.spacing,
                   bodies_[body].motion.at(time_).rotation.conjugate() * up);
  }

  /// Replaces a body's motion, from now on. While there is liquid, the new motion has to begin where the body is: a
  /// jump would leave its liquid behind. (move_body takes a body anywhere, along a path.)
  void set_motion(BodyId body, PoseTrack motion) {
    expects(body < bodies_.size(), "Simulator: body", "one that was added", body);
    const Pose now = bodies_[body].motion.at(time_), then = motion.at(time_);
    const double jump = (then.translation - now.translation).norm() +
                        now.rotation.angularDistance(then.rotation) * bodies_[body].bounds.diagonal().norm();
    expects(fluid_.size() == 0 || jump < 1e-3 * settings_.spacing, "Simulator: jump of a body in set_motion [m]",
            "below a thousandth of the spacing while there is liquid", jump);
    bodies_.set_motion(body, std::move(motion));
  }

  /// Lets a body move from where it is to `pose` during the next `duration` > 0 [s]: for poses that arrive frame by
  /// frame.
  void move_body(BodyId body, const Pose& pose, double duration) {
    expects(body < bodies_.size(), "Simulator: body", "one that was added", body);
    expects(duration > 0 && std::isfinite(duration), "Simulator: duration of a body's move [s]", "> 0 and finite",
            duration);
    const Pose now = bodies_[body].motion.at(time_);
    bodies_.set_motion(body, PoseTrack({{time_, now}, {time_ + duration, pose}}));
  }

  /// From the next frame on reports say how much liquid is in this body (StepReport::contents), asked as Contents does:
  /// in the body's own frame, so that what is above the plane of the rim is not in it. The body's space is looked for
  /// here, some tenths of a second for a scan. A frame then takes about 60 ns more for each particle in the container
  /// and 5 ns for each elsewhere, well below a per cent of its time.
  /// @param up the container's axis, out of its opening, in its own frame. Watching a body again replaces it.
  /// Throws std::invalid_argument if the body holds no liquid that way up, or if ContentsList::capacity are watched.
  void watch_contents(BodyId body, const Vector3<double>& up = Vector3<double>::UnitZ()) {
    expects(body < bodies_.size(), "Simulator: body", "one that was added", body);
    auto cavity = std::make_shared<const Cavity>(bodies_[body].surface, up);
    expects(!cavity->empty(), "Simulator: body '" + bodies_[body].name + "' to watch", "one that holds liquid",
            "no cavity");
    for (auto& [watched, space] : watched_) {
      if (watched == body) {
        space = std::move(cavity);
        return;
      }
    }
    expects(watched_.size() < ContentsList::capacity, "Simulator: number of watched containers",
            "at most " + std::to_string(ContentsList::capacity), watched_.size() + 1);
    watched_.push_back({body, std::move(cavity)});
  }

  /// Adds particles of one spacing's volume each. @param position, velocity 3xN, [m] and [m/s], world frame, finite.
  /// Throws std::invalid_argument if they are not, or if there would be more than most_particles.
  void add_particles(const ConstPointsView<Scalar>& position, const ConstPointsView<Scalar>& velocity, Origin origin) {
    expects(position.cols() == velocity.cols(), "Simulator: number of velocities", "that of positions",
            velocity.cols());
    expects(static_cast<double>(fluid_.size() + position.cols()) <= most_particles, "Simulator: number of particles",
            "at most 1e8", fluid_.size() + position.cols());
    expects(position.allFinite(), "Simulator: positions of new particles", "finite", "NaN or infinity");
    expects(velocity.allFinite(), "Simulator: velocities of new particles", "finite", "NaN or infinity");
    for (Index k = 0; k < position.cols(); ++k) {
      append(position.col(k), velocity.col(k), origin);
    }
  }

  /// Adds an inlet; its liquid gets `origin`.
  void add_inlet(const InletSettings& inlet, Origin origin) {
    inlets_.push_back({Inlet(inlet, settings_.spacing), origin});
  }

  /// Inlets are numbered in the order in which they were added.
  std::size_t inlet_count() const noexcept { return inlets_.size(); }
  /// @param number < inlet_count().
  const Inlet& inlet(std::size_t number) const noexcept { return inlets_[number].first; }
  /// Another flow from now on. Throws std::invalid_argument for an inlet that there is not, and as Inlet::set_flow.
  void set_inlet_flow(std::size_t number, std::vector<std::pair<double, double>> flow) {
    expects(number < inlets_.size(), "Simulator: number of an inlet", "one that was added", number);
    inlets_[number].first.set_flow(std::move(flow));
  }

  /// Adds an outlet: particles leave at the flow that it is asked for, as far as there is liquid within its radius
  /// (StepReport::drained). Where it has an exit, a particle goes on there, the same one (id, origin), as soon as there
  /// is a place near the exit a spacing off all other liquid; until then it stays, and so does all that would follow.
  /// Throws std::invalid_argument if a setting is out of range, its body was not added, or the exit is in the body's
  /// material.
  void add_outlet(const OutletSettings& settings) {
    Outlet outlet(settings, settings_.spacing);
    if (settings.body) {
      expects(*settings.body < bodies_.size(), "Outlet: body", "one that was added", *settings.body);
      if (settings.exit) {
        bodies_.set_interval(time_, 0);
        probe_.resize(1);
        probe_.position.col(0) = (bodies_[*settings.body].motion.at(time_) * *settings.exit).template cast<Scalar>();
        expects(bodies_.push_out(*settings.body, 0, probe_) == 0, "Outlet: exit [m]", "outside of its body's material",
                settings.exit->transpose());
      }
    }
    outlets_.push_back(std::move(outlet));
  }

  /// Removes all particles for which f(index) is true. @return how many.
  template <class Predicate>
  Index remove_particles_if(Predicate&& f) {
    staying_.clear();
    staying_.reserve(static_cast<std::size_t>(fluid_.size()));
    for (Index i = 0; i < fluid_.size(); ++i) {
      if (!f(i)) {
        staying_.push_back(static_cast<std::uint32_t>(i));
      }
    }
    const Index removed = fluid_.size() - static_cast<Index>(staying_.size());
    if (removed > 0) {
      reorder(staying_);
      fluid_.resize(static_cast<Index>(staying_.size()));
    }
    return removed;
  }

  // ---- stepping ---------------------------------------------------------------------------------------------------

  /// Simulates `frame_time` >= 0 [s] in as many sub-steps as accuracy asks for. Never throws; a frame that fails leaves
  /// the state as it was and says why.
  [[nodiscard]] StepReport step(double frame_time) noexcept {
    StepReport report;
    if (!(frame_time >= 0) || !std::isfinite(frame_time)) {
      report.status = StepStatus::BadTimeStep;
      return report;
    }
    remember();
    if constexpr (requires { solver_.begin_frame(); }) {
      solver_.begin_frame();
    }
    remembered_walls_.forget();
    const double end = time_ + frame_time;
    bool converged = true;
    while (report.status == StepStatus::Ok && time_ < end) {
      if (report.sub_steps >= settings_.most_sub_steps) {
        report.status = StepStatus::TooManySteps;
        break;
      }
      const double left = end - time_;
      double time_step = choose_step(left, report.sub_steps);
      if (time_step <= 0) {
        report.status = fluid_finite() ? StepStatus::TooManySteps : StepStatus::NonFinite;
        break;
      }
      const double reached = time_step < left ? time_ + time_step : end;
      time_step = reached - time_;
      converged = sub_step(time_step, report) && converged;
      time_ = reached;
      ++report.sub_steps;
    }
    if (report.status == StepStatus::Ok) {
      report.non_finite = count_non_finite();
      if (report.non_finite > 0) {
        report.status = StepStatus::NonFinite;
      }
    }
    if (report.status != StepStatus::Ok) {
      recall();
    } else if (!converged) {
      report.status = StepStatus::NotConverged;
    }
    lost_ += report.advanced() ? report.lost : 0;
    report.lost = lost_;
    drained_ += report.advanced() ? report.drained : 0;
    report.drained = drained_;
    summarize(report);
    count_contents(report);
    return report;
  }

  /// Lets the liquid come to rest with all bodies held where they are: steps with friction, at most `most_time` [s] of
  /// them, until the mean speed is below `speed` [m/s]. Time does not advance, and velocities are zero afterwards.
  StepReport settle(double most_time = 2.0, double speed = 0.005) {
    const double start = time_;
    Bodies moving = bodies_;
    for (BodyId body = 0; body < bodies_.size(); ++body) {
      bodies_.set_motion(body, PoseTrack(moving[body].motion.at(start)));
    }
    std::vector<InletWithOrigin> inlets;
    inlets.swap(inlets_);
    std::vector<Outlet> outlets;
    outlets.swap(outlets_);
    StepReport report;
    const double slice = 0.02;
    for (double spent = 0; spent < most_time && fluid_.size() > 0; spent += slice) {
      report = step(slice);
      if (!report.advanced()) {
        break;
      }
      const double mean_square = 2 * report.kinetic_energy / std::max(total_mass(), 1e-300);
      if (spent > 2 * slice && mean_square < speed * speed) {
        break;
      }
      fluid_.velocity *= Scalar(0.5);
    }
    fluid_.velocity.setZero();
    inlets_.swap(inlets);
    outlets_.swap(outlets);
    bodies_ = std::move(moving);
    time_ = start;
    return report;
  }

  /// Takes over places that a corrector gave the particles. Where a wall stands in the straight way from where they
  /// were, the move ends at the wall; a move of more than `longest_path` [m] counts as taken from one place to another,
  /// and only must not end inside a body. What then is too dense is pushed apart in `sweeps` sweeps of PositionBased,
  /// 0 for none. Velocities stay as they are, but for what goes into a wall that stopped a move; time does not advance,
  /// particles may come into another order.
  /// @param before 3xN [m], where the particles were, in the order of fluid(). @return how many moves were cut short.
  Index adopt_moves(const ConstPointsView<Scalar>& before, double longest_path, int sweeps) noexcept {
    bodies_.set_interval(time_, 0);
    before_ = before;
    const auto farthest = static_cast<Scalar>(longest_path * longest_path);
    taken_.clear();
    for (Index i = 0; i < fluid_.size(); ++i) {
      if (!fluid_.position.col(i).allFinite()) {
        fluid_.position.col(i) = before_.col(i);
      } else if ((fluid_.position.col(i) - before_.col(i)).squaredNorm() > farthest) {
        taken_.push_back(static_cast<std::uint32_t>(i));
      }
    }
    if (!taken_.empty()) {
      kept_velocity_ = fluid_.velocity;
      for (BodyId body = 0; body < bodies_.size(); ++body) {
        if constexpr (requires { bodies_.push_out(body, 1.0, fluid_, settings_.threads); }) {
          bodies_.push_out(body, 0.5 * settings_.spacing, fluid_, settings_.threads);
        } else {
          bodies_.push_out(body, 0.5 * settings_.spacing, fluid_);
        }
      }
      fluid_.velocity = kept_velocity_;
      for (const std::uint32_t i : taken_) {
        before_.col(i) = fluid_.position.col(i);  // no path to look after
      }
    }
    remembered_walls_.sample(bodies_, time_, before_, settings_.spacing, settings_.threads, walls_);
    Index cut_short = keep_on_sides();  // this takes the speed into walls
    if (sweeps > 0 && fluid_.size() > 0) {
      sort_into_lists();
      remembered_walls_.sample(bodies_, time_, fluid_.position, settings_.spacing, settings_.threads, walls_);
      shield_.apply(bodies_, walls_, neighbors_, settings_.threads);
      kept_velocity_ = fluid_.velocity;
      fluid_.velocity.setZero();
      apart_.most_iterations = sweeps;
      apart_.recovery = 1;
      apart_.measures_what_is_left = false;
      PressureReport report;
      apart_.solve(view(1), report);
      before_ = fluid_.position;
      fluid_.position += fluid_.velocity;
      fluid_.velocity = kept_velocity_;
      cut_short += keep_on_sides();
      fluid_.velocity = kept_velocity_;
    }
    return cut_short;
  }

  // ---- what there is ----------------------------------------------------------------------------------------------

  /// The particles; may be read and written between frames (positions, velocities), without a copy. To add or remove
  /// particles use the functions above.
  FluidState<Scalar>& fluid() noexcept { return fluid_; }
  const FluidState<Scalar>& fluid() const noexcept { return fluid_; }

  const Bodies& bodies() const noexcept { return bodies_; }
  const SimulatorSettings& settings() const noexcept { return settings_; }
  const Domain& domain() const noexcept { return domain_; }
  double time() const noexcept { return time_; }                          ///< [s]
  double spacing() const noexcept { return settings_.spacing; }           ///< of particles [m]
  double smoothing_length() const noexcept { return smoothing_length_; }  ///< [m]

  /// A part, to read or change its settings.
  template <class Force>
  Force& force() noexcept {
    return std::get<Force>(forces_);
  }
  Solver& pressure_solver() noexcept { return solver_; }

  /// As of the last sub-step: what walls contributed at each particle. In the order of fluid().
  const WallState<Scalar>& walls() const noexcept { return walls_; }

  /// Force of the liquid on a body as of the last sub-step, by pressure [N], world frame.
  Vector3<double> pressure_force_on(BodyId body) const noexcept {
    Vector3<double> total = Vector3<double>::Zero();
    for (Index i = 0; i < fluid_.size() && i < walls_.share.count(); ++i) {
      const WallContact<Scalar>* contacts = walls_.contacts_of(i);
      const double density = std::max(static_cast<double>(fluid_.density[i]), settings_.liquid.density);
      const double push = static_cast<double>(fluid_.mass[i]) * settings_.liquid.density *
                          static_cast<double>(fluid_.pressure[i]) / (density * density);
      for (int k = 0; k < walls_.contact_count[i]; ++k) {
        if (contacts[k].body == body) {
          Vector3<Scalar> gradient = contacts[k].gradient;
          if constexpr (wants_correction<Solver>) {
            gradient = correction_.at_wall(i, gradient);
          }
          total += push * gradient.template cast<double>();
        }
      }
    }
    return total;
  }

  // ---- snapshots --------------------------------------------------------------------------------------------------

  /// All that the future depends on, and which containers are watched. A run that is restored continues bit for bit as
  /// the first one did.
  struct Snapshot {
    FluidState<Scalar> fluid;
    typename Solver::Memory memory;
    Bodies bodies;
    double time, longest_step;
    std::uint32_t next_id;
    Index lost;
    std::vector<std::pair<Inlet, Origin>> inlets;
    std::vector<std::pair<BodyId, std::shared_ptr<const Cavity>>> watched;
    std::vector<Outlet> outlets;
    double drained;
  };

  Snapshot snapshot() const {
    return {fluid_,        const_cast<Solver&>(solver_).memory(),
            bodies_,       time_,
            longest_step_, next_id_,
            lost_,         inlets_,
            watched_,      outlets_,
            drained_};
  }

  void restore(const Snapshot& snapshot) {
    fluid_ = snapshot.fluid;
    solver_.memory() = snapshot.memory;
    bodies_ = snapshot.bodies;
    remembered_walls_.forget();
    time_ = snapshot.time;
    longest_step_ = snapshot.longest_step;
    next_id_ = snapshot.next_id;
    lost_ = snapshot.lost;
    inlets_ = snapshot.inlets;
    watched_ = snapshot.watched;
    outlets_ = snapshot.outlets;
    drained_ = snapshot.drained;
  }

 private:
  /// Of a sub-step over the one before. While liquid bounces its pressure comes and goes, and the solver's limit with
  /// it.
  static constexpr double largest_growth = 1.03;

  using InletWithOrigin = std::pair<Inlet, Origin>;
  using Watched = std::pair<BodyId, std::shared_ptr<const Cavity>>;

  template <class Part>
  static constexpr bool wants_correction = requires {
    requires Part::uses_gradient_correction;
  };
  template <class Force>
  static constexpr bool acts_after_pressure = requires {
    requires Force::acts_after_pressure;
  };
  static constexpr bool corrects_gradients =
      wants_correction<Solver> || []<class... Terms>(std::type_identity<std::tuple<Terms...>>) {
        return (wants_correction<Terms> || ...);
      }(std::type_identity<Forces>{});

  /// Parts that know gravity, viscosity, surface tension or limits by these names take them from the settings.
  template <class Part>
  void configure(Part& part) {
    if constexpr (requires { part.acceleration = settings_.gravity.template cast<Scalar>(); }) {
      part.acceleration = settings_.gravity.template cast<Scalar>();
    }
    if constexpr (requires { part.kinematic_viscosity = Scalar(0); }) {
      part.kinematic_viscosity = static_cast<Scalar>(settings_.liquid.kinematic_viscosity());
    }
    if constexpr (requires { part.numerical_viscosity = Scalar(0); }) {
      part.numerical_viscosity = static_cast<Scalar>(settings_.numerical_viscosity * settings_.spacing *
                                                     std::sqrt(settings_.gravity.norm() * settings_.spacing));
      if constexpr (requires { part.pressure_share = Scalar(0); }) {
        part.pressure_share = static_cast<Scalar>(settings_.numerical_viscosity / 3);
      }
    }
    if constexpr (requires { part.tolerance_factor = Scalar(1); }) {
      part.tolerance_factor = static_cast<Scalar>(settings_.tolerance_factor);
    }
    if constexpr (requires { part.stability_number = Scalar(1); }) {
      part.stability_number = static_cast<Scalar>(settings_.stability_number);
    }
    if constexpr (requires { part.surface_tension = Scalar(0); }) {
      part.surface_tension = static_cast<Scalar>(settings_.liquid.surface_tension);
    }
  }

  void append(const Vector3<Scalar>& position, const Vector3<Scalar>& velocity, Origin origin) {
    append(position, velocity, origin, particle_mass(), next_id_++);
  }

  void append(const Vector3<Scalar>& position, const Vector3<Scalar>& velocity, Origin origin, Scalar mass,
              std::uint32_t id) {
    const Index i = fluid_.size();
    fluid_.resize(i + 1);
    fluid_.position.col(i) = position;
    fluid_.velocity.col(i) = velocity;
    fluid_.mass[i] = mass;
    fluid_.density[i] = static_cast<Scalar>(settings_.liquid.density);
    fluid_.pressure[i] = 0;
    fluid_.id[i] = id;
    fluid_.origin[i] = origin;
  }

  Scalar particle_mass() const noexcept {
    return static_cast<Scalar>(settings_.liquid.density * settings_.spacing * settings_.spacing * settings_.spacing);
  }

  double total_mass() const noexcept { return fluid_.mass.template cast<double>().sum(); }

  Step view(double time_step) noexcept {
    return {fluid_,
            neighbors_,
            pairs_,
            walls_,
            correction_,
            shift_,
            static_cast<Scalar>(smoothing_length_),
            static_cast<Scalar>(settings_.spacing),
            static_cast<Scalar>(settings_.liquid.density),
            static_cast<Scalar>(time_step),
            time_,
            settings_.threads};
  }

  /// The longest sub-step that is accurate and stable now, at most `left`; 0 if there is none.
  double choose_step(double left, int taken) noexcept {
    if (settings_.fixed_step > 0) {
      // a rest that is only rounding would make a sub-step of no length
      return left < settings_.fixed_step * (1 + 1e-9) ? left : settings_.fixed_step;
    }
    double longest = settings_.largest_step;
    bodies_.set_interval(time_, std::min(left, longest));
    double speed = bodies_.largest_relative_speed(fluid_, settings_.threads, reduction_);
    for (const auto& [inlet, origin] : inlets_) {
      speed = std::max(speed, inlet.speed(time_));
    }
    for (const Outlet& outlet : outlets_) {
      speed = std::max(speed, outlet.exit_speed(time_));
    }
    if (!std::isfinite(speed)) {
      return 0;
    }
    longest = std::min(longest, longest_step_ > 0 ? largest_growth * longest_step_ : first_step());
    if (speed > 0) {
      longest = std::min(longest, settings_.courant_number * settings_.spacing / speed);
    }
    const Step step = view(longest);
    longest = std::min(longest, static_cast<double>(solver_.largest_step(step)));
    std::apply(
        [&](auto&... terms) { ((longest = std::min(longest, static_cast<double>(terms.largest_step(step)))), ...); },
        forces_);
    if (!(longest > 0) || left / longest > settings_.most_sub_steps - taken + 1) {
      return 0;
    }
    longest_step_ = longest;
    return left / std::max(1.0, std::ceil(left / longest - 1e-9));
  }

  /// At first no solver knows how much pressure there will be: at most that of all liquid in one column.
  double first_step() const noexcept {
    const Vector3<double> weight = settings_.gravity;
    double low = 0, high = 0;
    for (Index i = 0; i < fluid_.size(); ++i) {
      const double head = weight.dot(fluid_.position.col(i).template cast<double>());
      low = i == 0 ? head : std::min(low, head);
      high = i == 0 ? head : std::max(high, head);
    }
    const double head = high - low + weight.norm() * settings_.spacing;
    return head > 0 ? 0.2 * settings_.spacing / std::sqrt(head) : settings_.largest_step;
  }

  /// @return whether the pressure solver converged.
  bool sub_step(double time_step, StepReport& report) noexcept {
    StepTimes& times = report.times;
    let_out(time_step, report);
    bodies_.set_interval(time_, time_step);
    pour_in(time_step);
    find_neighbors(times);
    const Step step = view(time_step);
    timed(times.sums_ms, [&] {
      pairs_.compute(step);
      if constexpr (corrects_gradients) {
        correction_.compute(step);
      }
    });
    PressureReport pressure;
    shift_.set_count(fluid_.size());
    shift_.setZero();
    timed(times.pressure_ms, [&] { solver_.begin_step(step, pressure); });
    timed(times.forces_ms, [&] { apply_forces<false>(step); });
    timed(times.pressure_ms, [&] { solver_.solve(step, pressure); });
    timed(times.forces_ms, [&] { apply_forces<true>(step); });
    if constexpr (requires { solver_.correct_places(step, pressure); }) {
      timed(times.pressure_ms, [&] { solver_.correct_places(step, pressure); });
    }
    timed(times.moving_ms, [&] { advance(time_step, report); });

    report.density_iterations += pressure.density_iterations;
    report.divergence_iterations += pressure.divergence_iterations;
    report.density_error = std::max(report.density_error, pressure.density_error);
    report.divergence_error = std::max(report.divergence_error, pressure.divergence_error);
    return pressure.converged;
  }

  template <class Work>
  static void timed(double& total_ms, Work&& work) noexcept {
    const Stopwatch watch(total_ms);
    work();
  }

  template <bool after_pressure>
  void apply_forces(const Step& step) noexcept {
    acceleration_.resize(3, fluid_.size());
    acceleration_.setZero();
    const auto apply = [&]<class Force>(Force& term) {
      if constexpr (acts_after_pressure<Force> == after_pressure) {
        term.accumulate(step, acceleration_);
      }
    };
    std::apply([&](auto&... terms) { (apply(terms), ...); }, forces_);
    parallel_for(fluid_.size(), settings_.threads,
                 [&](Index i) { fluid_.velocity.col(i) += step.time_step * acceleration_.col(i); });
  }

  void pour_in(double time_step) noexcept {
    for (auto& [inlet, origin] : inlets_) {
      inlet.advance(time_, time_step, [&, from = origin](const Vector3<double>& x, const Vector3<double>& v) {
        append(x.cast<Scalar>(), v.cast<Scalar>(), from);
      });
    }
  }

  /// What goes on from an exit is taken out and put in again: solvers remember nothing of its old place. Leaves the
  /// bodies' interval undefined.
  void let_out(double time_step, StepReport& report) noexcept {
    for (Outlet& outlet : outlets_) {
      const OutletSettings& asked = outlet.settings();
      const Pose world_from_frame = asked.body ? bodies_[*asked.body].motion.at(time_) : Pose{};
      leaving_.clear();
      emerging_.resize(0);
      outlet.advance(time_, time_step, world_from_frame, fluid_, domain_, candidates_, [&](Index i) {
        if (asked.exit) {
          if (!find_exit_place(outlet, world_from_frame)) {
            return 0.0;
          }
          const RigidVelocity frame =
              asked.body ? bodies_[*asked.body].motion.velocity(time_, time_step) : RigidVelocity{};
          const Vector3<Scalar> x = probe_.position.col(0);
          const Vector3<double> v =
              frame.at(x.template cast<double>()) + world_from_frame.rotation * asked.exit_velocity;
          const Index last = emerging_.size();
          emerging_.resize(last + 1);
          emerging_.position.col(last) = x;
          emerging_.velocity.col(last) = v.template cast<Scalar>();
          emerging_.mass[last] = fluid_.mass[i];
          emerging_.id[last] = fluid_.id[i];
          emerging_.origin[last] = fluid_.origin[i];
        }
        leaving_.push_back(static_cast<std::uint32_t>(i));
        const double volume = static_cast<double>(fluid_.mass[i]) / settings_.liquid.density;
        report.drained += volume;
        return volume;
      });
      if (leaving_.empty()) {
        continue;
      }
      std::sort(leaving_.begin(), leaving_.end());
      remove_particles_if(
          [&](Index i) { return std::binary_search(leaving_.begin(), leaving_.end(), static_cast<std::uint32_t>(i)); });
      for (Index k = 0; k < emerging_.size(); ++k) {
        append(emerging_.position.col(k), emerging_.velocity.col(k), emerging_.origin[k], emerging_.mass[k],
               emerging_.id[k]);
      }
    }
  }

  /// Looks for a place near an outlet's exit, on its side of all walls, half a spacing off them and a spacing off all
  /// liquid, so that nothing is pushed apart. @return whether there is one; it is in probe_.
  bool find_exit_place(const Outlet& outlet, const Pose& world_from_frame) noexcept {
    const double clearance = 0.5 * settings_.spacing;
    bodies_.set_interval(time_, 0);
    exit_.set_count(1);
    exit_.col(0) = (world_from_frame * *outlet.settings().exit).template cast<Scalar>();
    probe_.resize(1);
    probe_.position.col(0) = exit_.col(0);
    for (BodyId body = 0; body < bodies_.size(); ++body) {
      if (bodies_.push_out(body, clearance, probe_) > 0) {
        return false;  // a body stands where the exit is
      }
    }
    bodies_.sample(exit_, settings_.spacing, settings_.threads, exit_walls_);
    for (const Vector3<double>& place : outlet.places()) {
      probe_.position.col(0) = (world_from_frame * place).template cast<Scalar>();
      const GuardReport guard = bodies_.guard(exit_, clearance, settings_.threads, exit_walls_, probe_);
      if (guard.lost == 0 && is_clear(probe_.position.col(0), fluid_) && is_clear(probe_.position.col(0), emerging_)) {
        return true;
      }
    }
    return false;
  }

  /// No particle nearer than one spacing, but for rounding and for what is behind the walls at the exit.
  bool is_clear(const Vector3<Scalar>& x, const FluidState<Scalar>& fluid) const noexcept {
    const auto least = static_cast<Scalar>(0.99 * settings_.spacing);
    for (Index i = 0; i < fluid.size(); ++i) {
      const Vector3<Scalar> other = fluid.position.col(i);
      if (domain_.separation(other, x).squaredNorm() < least * least &&
          !bodies_.separated(x, other, exit_walls_.contacts_of(0), exit_walls_.contact_count[0])) {
        return false;
      }
    }
    return true;
  }

  void find_neighbors(StepTimes& times) noexcept {
    timed(times.sorting_ms, [&] { sort_into_lists(); });
    timed(times.walls_ms, [&] {
      bodies_.sample(fluid_.position, settings_.spacing, settings_.threads, walls_);
      shield_.apply(bodies_, walls_, neighbors_, settings_.threads);
    });
  }

  void sort_into_lists() noexcept {
    const double support = settings_.spacing * settings_.support_in_spacings;
    const Scalar reach = static_cast<Scalar>(support * (1 + static_cast<double>(Solver::search_margin)));
    search_.rebuild(fluid_.position, reach, settings_.threads);
    if constexpr (requires { search_.order(); }) {
      const auto order = search_.order();
      reorder({order.data(), order.size()});
      search_.adopt_order(settings_.threads);
    }
    neighbors_.build_from(search_, fluid_.position, settings_.threads);
  }

  void advance(double time_step, StepReport& report) noexcept {
    before_ = fluid_.position;
    const Scalar dt = static_cast<Scalar>(time_step);
    parallel_for(fluid_.size(), settings_.threads,
                 [&](Index i) { fluid_.position.col(i) += dt * fluid_.velocity.col(i) + shift_.col(i); });
    const GuardReport guard = bodies_.guard(before_, 0.1 * settings_.spacing, settings_.threads, walls_, fluid_);
    report.guarded += guard.slid + guard.stopped;
    report.lost += guard.lost;
    if constexpr (Domain::periodic) {
      parallel_for(fluid_.size(), settings_.threads,
                   [&](Index i) { fluid_.position.col(i) = domain_.wrap(Vector3<Scalar>(fluid_.position.col(i))); });
    }
  }

  /// The guard for moves that are not motion: from before_, at walls that stand.
  Index keep_on_sides() noexcept {
    const GuardReport guard = bodies_.guard(before_, 0.1 * settings_.spacing, settings_.threads, walls_, fluid_);
    return guard.slid + guard.stopped + guard.lost;
  }

  /// Puts the particles into another order: place k gets what was at order[k].
  void reorder(std::span<const std::uint32_t> order) {
    fluid_.each([&](auto& array) {
      auto& moved = scratch_of(array);
      moved.set_count(static_cast<Index>(order.size()));
      parallel_for(static_cast<Index>(order.size()), settings_.threads, [&](Index k) {
        const auto from = static_cast<Index>(order[static_cast<std::size_t>(k)]);
        if constexpr (std::decay_t<decltype(array)>::RowsAtCompileTime == 3) {
          moved.col(k) = array.col(from);
        } else {
          moved[k] = array[from];
        }
      });
      std::swap(moved, array);
    });
    solver_.memory().reorder(order);
    remembered_walls_.reorder(order, settings_.threads, walls_);
  }

  auto& scratch_of(Growable<Scalar, 3>&) noexcept { return scratch_points_; }
  auto& scratch_of(Growable<Scalar, 1>&) noexcept { return scratch_scalars_; }
  auto& scratch_of(Growable<std::uint32_t, 1>&) noexcept { return scratch_numbers_; }

  void remember() {
    kept_fluid_ = fluid_;
    kept_memory_ = solver_.memory();
    kept_inlets_ = inlets_;
    kept_outlets_ = outlets_;
    kept_time_ = time_;
    kept_longest_step_ = longest_step_;
    kept_next_id_ = next_id_;
  }

  void recall() {
    fluid_ = kept_fluid_;
    solver_.memory() = kept_memory_;
    inlets_ = kept_inlets_;
    outlets_ = kept_outlets_;
    time_ = kept_time_;
    longest_step_ = kept_longest_step_;
    next_id_ = kept_next_id_;
  }

  bool fluid_finite() const noexcept { return fluid_.position.allFinite() && fluid_.velocity.allFinite(); }

  Index count_non_finite() const noexcept {
    Index count = 0;
    for (Index i = 0; i < fluid_.size(); ++i) {
      count += fluid_.position.col(i).allFinite() && fluid_.velocity.col(i).allFinite() ? 0 : 1;
    }
    return count;
  }

  void summarize(StepReport& report) const noexcept {
    report.particles = fluid_.size();
    double energy = 0, mass = 0;
    for (Index i = 0; i < fluid_.size(); ++i) {
      const double m = static_cast<double>(fluid_.mass[i]);
      mass += m;
      energy += 0.5 * m * static_cast<double>(fluid_.velocity.col(i).squaredNorm());
    }
    report.kinetic_energy = energy;
    report.volume = mass / settings_.liquid.density;
  }

  void count_contents(StepReport& report) noexcept {
    for (const Watched& watched : watched_) {
      const Cavity& cavity = *watched.second;
      const Pose body_from_world = bodies_[watched.first].motion.at(time_).inverse();
      const Matrix3<double> turn = body_from_world.rotation.toRotationMatrix();
      ContainedLiquid contained = counting_.over(
          fluid_.size(), settings_.threads, ContainedLiquid{},
          [&](Index begin, Index end) {
            ContainedLiquid found;
            for (Index i = begin; i < end; ++i) {
              const Vector3<double> x = fluid_.position.col(i).template cast<double>();
              if (cavity.contains(turn * x + body_from_world.translation)) {
                ++found.particles;
                found.volume += static_cast<double>(fluid_.mass[i]) / settings_.liquid.density;
              }
            }
            return found;
          },
          [](const ContainedLiquid& a, const ContainedLiquid& b) {
            return ContainedLiquid{a.body, a.particles + b.particles, a.volume + b.volume};
          });
      contained.body = watched.first;
      report.contents.push_back(contained);
    }
  }

  SimulatorSettings settings_;
  Domain domain_;
  double smoothing_length_ = 0;
  Search search_;
  Forces forces_{};
  Solver solver_{};
  Bodies bodies_{};
  std::vector<InletWithOrigin> inlets_{};
  std::vector<Outlet> outlets_{};
  std::vector<Watched> watched_{};

  FluidState<Scalar> fluid_{};
  Neighbors neighbors_;
  PairKernel<Scalar> pairs_{};
  WallState<Scalar> walls_{};
  WallShield<Scalar> shield_{};
  GradientCorrection<Scalar> correction_{};
  double time_ = 0;
  double longest_step_ = 0;  ///< that the last sub-step could have been; 0 before the first
  std::uint32_t next_id_ = 0;
  Index lost_ = 0;
  double drained_ = 0;  ///< [m^3]

  // scratch, and the state before the frame for frames that fail
  PointArray<Scalar> acceleration_{};
  Growable<Scalar, 3> before_{};
  Growable<Scalar, 3> kept_velocity_{};
  PositionBased<Scalar> apart_{};
  std::vector<std::uint32_t> taken_{};  ///< particles that a corrector took from one place to another
  std::vector<std::uint32_t> staying_{}, leaving_{};
  std::vector<Outlet::Candidate> candidates_{};
  FluidState<Scalar> emerging_{}, probe_{};
  Growable<Scalar, 3> exit_{};
  WallState<Scalar> exit_walls_{};
  RememberedWalls<Scalar> remembered_walls_{};
  Growable<Scalar, 3> shift_{};
  Growable<Scalar, 3> scratch_points_{};
  Growable<Scalar, 1> scratch_scalars_{};
  Growable<std::uint32_t, 1> scratch_numbers_{};
  Reduction<double> reduction_{};
  Reduction<ContainedLiquid> counting_{};
  FluidState<Scalar> kept_fluid_{};
  typename Solver::Memory kept_memory_{};
  std::vector<InletWithOrigin> kept_inlets_{};
  std::vector<Outlet> kept_outlets_{};
  double kept_time_ = 0, kept_longest_step_ = 0;
  std::uint32_t kept_next_id_ = 0;
};

/// The ready-made simulator.
using LiquidSimulator = Simulator<DefaultParts<>>;

}  // namespace decant::inline DECANT_TARGET
