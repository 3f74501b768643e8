// SPDX-License-Identifier: MIT
#pragma once

/// The default corrector: transport of the silhouette, with relocation of mass in between, and a fit of its edge.

#include <utility>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/correction/concept.hpp>
#include <decant/correction/edge_fit.hpp>
#include <decant/correction/mass_relocation.hpp>
#include <decant/correction/transport_corrector.hpp>

namespace decant::inline DECANT_TARGET {

/// The first half of the transport's passes brings what was predicted to where it was seen, as far as it is the same
/// liquid; what then is seen and not simulated, or the other way round, is in the wrong place, and is relocated; the
/// other half brings near what was relocated, and the last passes fit the edge.
template <class ScalarType = float, class CameraType = DistortedPinholeCamera>
class SilhouetteCorrector {
 public:
  using Scalar = ScalarType;
  using Observation = Silhouettes<CameraType>;

  SilhouetteCorrector() = default;

  /// @param edge_passes how often the edge is fitted in a frame, >= 0: on pours of twins, three passes took away a
  /// quarter of what silhouettes lacked; the fourth gains another third of a point. Throws std::invalid_argument.
  SilhouetteCorrector(TransportCorrector<Scalar, CameraType> transport, MassRelocation<Scalar, CameraType> relocation,
                      EdgeFit<Scalar, CameraType> edge = EdgeFit<Scalar, CameraType>(), int edge_passes = 4)
      : transport_(std::move(transport)),
        relocation_(std::move(relocation)),
        edge_(std::move(edge)),
        edge_passes_(edge_passes) {
    expects(edge_passes >= 0, "SilhouetteCorrector: edge_passes", ">= 0", edge_passes);
  }

  int passes() const noexcept { return transport_.passes() + 1 + edge_passes_; }
  void reset() noexcept {
    transport_.reset();
    relocation_.reset();
    edge_.reset();
  }

  CorrectionReport correct(FluidState<Scalar>& fluid, const Observation& seen, Scalar dt) noexcept {
    const int turn = transport_.passes() / 2;
    if (seen.pass == turn) {
      return relocation_.correct(fluid, seen, dt);
    }
    if (seen.pass > transport_.passes()) {
      return edge_.correct(fluid, seen, dt);
    }
    Observation of_transport = seen;
    of_transport.pass = seen.pass < turn ? seen.pass : seen.pass - 1;
    return transport_.correct(fluid, of_transport, dt);
  }

 private:
  TransportCorrector<Scalar, CameraType> transport_{};
  MassRelocation<Scalar, CameraType> relocation_{};
  EdgeFit<Scalar, CameraType> edge_{};
  int edge_passes_ = 4;
};
static_assert(Corrector<SilhouetteCorrector<>>);

}  // namespace decant::inline DECANT_TARGET
