// The baseline of a record of velocities; that of accelerations stands with their integrals (amplitude.h).
#pragma once

#include "fem/amplitude.h"

namespace acopla::fem {

/// A record of velocities less the parabola c₀ + c₁ t + c₂ t² that it must lose to begin and end at rest and to end where it began: 0 at
/// the first and the last point and ∫v = 0, exactly for the record as it is, linear between its points. A wrong zero of the accelerations
/// below it, constant or growing as t, drifts away in velocities as t and t².
Amplitude correct_velocities(const Amplitude& velocities);

}  // namespace acopla::fem
