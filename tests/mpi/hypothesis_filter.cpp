// SPDX-License-Identifier: MIT
// HypothesisFilter over the processes that mpirun starts: in each of them, after each frame, the bits that a filter of
// threads has. Ends with status 0 if all of it holds in all of them.

#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <decant/correction/transport_corrector.hpp>
#include <decant/hypothesis/hypothesis_filter.hpp>
#include <decant/hypothesis/mpi_executor.hpp>

#include "require.hpp"
#include "tracking/falling_dust.hpp"

using namespace decant;
using decant_test::FallingDust;
using decant_test::require;

namespace {

using DustTracker = Tracker<FallingDust, TransportCorrector<double>>;

DustTracker falling_with(double gravity) {
  FallingDust model;
  model.dust.position.row(2).array() += 0.05;
  model.gravity = gravity;
  DustTracker tracker(model);
  tracker.add_camera(decant_test::seeing_camera(), decant_test::before_the_block());
  return tracker;
}

bool same(double a, double b) { return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b); }

bool same(const Overlap& a, const Overlap& b) {
  return a.compared_px == b.compared_px && a.predicted_px == b.predicted_px && a.observed_px == b.observed_px &&
         a.both_px == b.both_px && a.comparable == b.comparable;
}

/// All but the wall times, of which it is only asked that there are some.
bool same(const FrameReport& a, const FrameReport& b) {
  return a.status == b.status && same(a.time, b.time) && same(a.prior, b.prior) && same(a.posterior, b.posterior) &&
         same(a.log_likelihood, b.log_likelihood) && a.correction.moved == b.correction.moved &&
         same(a.correction.mean_shift, b.correction.mean_shift) && a.correction.relocated == b.correction.relocated &&
         same(a.relocated_volume, b.relocated_volume) && (a.physics_ms > 0) == (b.physics_ms > 0) &&
         (a.drawing_ms > 0) == (b.drawing_ms > 0) && (a.correction_ms > 0) == (b.correction_ms > 0) &&
         (a.relaxation_ms > 0) == (b.relaxation_ms > 0);
}

void same_bits_as_threads() {
  HypothesisFilterSettings settings;
  settings.posterior.least_squared = 0.5;  // dust is thin, and its model right to the last bit
  settings.least_probability = 1e-2;  // what is seen in a quarter of a second says no more than that
  MpiExecutor executor;
  HypothesisFilter<DustTracker> threads(settings, ThreadExecutor{{2}});
  HypothesisFilter<DustTracker, MpiExecutor> processes(settings, executor);
  constexpr std::size_t hypotheses = 5, fails = 1;
  std::size_t made = 0;
  for (std::size_t k = 0; k < hypotheses; ++k) {
    const double gravity = -static_cast<double>(k), log_prior = 0.1 * gravity;
    threads.add(falling_with(gravity), log_prior);
    if (k % 2 == 0) {
      processes.add(falling_with(gravity), log_prior);
      continue;
    }
    const auto make = [&] {
      ++made;
      return falling_with(gravity);
    };
    processes.add(make, log_prior);
  }
  std::size_t own = 0;
  for (std::size_t k = 0; k < hypotheses; ++k) {
    const bool here = k % executor.processes() == executor.process();
    require(processes.has_tracker(k) == here, "a tracker is where its hypothesis is kept");
    own += here && k % 2 == 1 ? 1 : 0;
    const std::string refused = decant_test::thrown_by([&] { static_cast<void>(processes.tracker(k)); });
    require(here ? refused.empty() : refused.find("one that this process keeps") != std::string::npos,
            "a tracker that is kept elsewhere is refused: " + refused);
  }
  require(made == own, "trackers are made only where they are kept");

  FallingDust reality = falling_with(-2).model();
  for (int frame = 1; frame <= 8; ++frame) {
    const std::string in_frame = ", frame " + std::to_string(frame);
    if (frame == 4) {
      threads.tracker(fails).model().broken = true;
      if (processes.has_tracker(fails)) {
        processes.tracker(fails).model().broken = true;
      }
    }
    reality.step(1 / 30.0);
    const Mask mask = decant_test::seen(reality.dust);
    const std::vector<CameraMask> masks{{0, mask}};
    const FrameReport one = threads.track({frame / 30.0, {}, masks});
    const FrameReport other = processes.track({frame / 30.0, {}, masks});
    require(one.status == FrameStatus::Ok && one.posterior.iou() > 0.7, "the frame goes well" + in_frame);
    require(same(one, other), "report" + in_frame);
    require(threads.best() == processes.best(), "best" + in_frame);
    require(threads.running() == processes.running(), "running" + in_frame);
    require(same(threads.probability_of_none(), processes.probability_of_none()), "none of these" + in_frame);
    for (std::size_t k = 0; k < hypotheses; ++k) {
      const std::string of = " of hypothesis " + std::to_string(k) + in_frame;
      require(same(threads.log_posterior(k), processes.log_posterior(k)), "log posterior" + of);
      require(same(threads.probability(k), processes.probability(k)), "probability" + of);
      require(same(threads.posterior().misfit(k).squared, processes.posterior().misfit(k).squared), "misfit" + of);
      require(same(threads.posterior().misfit(k).measured, processes.posterior().misfit(k).measured), "measured" + of);
      require(threads.given_up(k) == processes.given_up(k), "given up" + of);
      require(same(threads.report(k), processes.report(k)), "report" + of);
      require(!processes.given_up(k) || !processes.has_tracker(k), "no tracker of one that was given up" + of);
    }
  }
  require(threads.best() == 2, "what is so is found");
  require(threads.given_up(fails) && std::isinf(threads.log_posterior(fails)), "one failed");
  require(threads.given_up(4) && std::isfinite(threads.log_posterior(4)), "one became too improbable");
  require(threads.running() >= 2, "others stand");

  HypothesisFilter<DustTracker, MpiExecutor> empty(settings, executor);
  require(empty.track({0.1, {}, {}}).status == FrameStatus::BadInput, "no hypothesis");
}

}  // namespace

int main(int argc, char** argv) {
  int level = 0;
  MPI_Init_thread(&argc, &argv, MPI_THREAD_FUNNELED, &level);
  same_bits_as_threads();
  MPI_Finalize();
  return 0;
}
