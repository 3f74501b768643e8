// SPDX-License-Identifier: MIT
#pragma once

/// The default corrector: transport of the silhouette with relocation of mass in between.

#include <decant/correction/concept.hpp>
#include <decant/correction/mass_relocation.hpp>
#include <decant/correction/transport_corrector.hpp>

namespace decant {

/// The first half of the transport's passes brings what was predicted to where it was seen, as far as it is the same
/// liquid; what then is seen and not simulated, or the other way round, is in the wrong place, and is relocated; the
/// other passes mend edges.
template <class ScalarType = float, class CameraType = DistortedPinholeCamera>
class SilhouetteCorrector {
 public:
  using Scalar = ScalarType;
  using Observation = Silhouettes<CameraType>;

  SilhouetteCorrector() = default;
  SilhouetteCorrector(TransportCorrector<Scalar, CameraType> transport, MassRelocation<Scalar, CameraType> relocation)
      : transport_(std::move(transport)), relocation_(std::move(relocation)) {}

  int passes() const noexcept { return transport_.passes() + 1; }
  void reset() noexcept {
    transport_.reset();
    relocation_.reset();
  }

  CorrectionReport correct(FluidState<Scalar>& fluid, const Observation& seen, Scalar dt) noexcept {
    const int turn = transport_.passes() / 2;
    if (seen.pass == turn) {
      return relocation_.correct(fluid, seen, dt);
    }
    Observation of_transport = seen;
    of_transport.pass = seen.pass < turn ? seen.pass : seen.pass - 1;
    return transport_.correct(fluid, of_transport, dt);
  }

 private:
  TransportCorrector<Scalar, CameraType> transport_{};
  MassRelocation<Scalar, CameraType> relocation_{};
};
static_assert(Corrector<SilhouetteCorrector<>>);

}  // namespace decant
