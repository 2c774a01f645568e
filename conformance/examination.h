// Plays the coupler against a participant and finds out, rule by rule, what it does right and wrong.
#pragma once

#include "conformance/rehearsal.h"
#include "conformance/report.h"

namespace acopla::conformance {

/// Starts the participant a dozen times. What it does wrong is in the report. @throws io::UserError when it cannot be started at all
Report examine(Subject& subject, const Plan& plan);

}  // namespace acopla::conformance
