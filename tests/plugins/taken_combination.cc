// Nothing new: a combination that the program has.
#include "dem/laws.h"

ACOPLA_LAWS(laws) { laws.add<acopla::dem::Hertz, acopla::dem::Mindlin, acopla::dem::FreeRolling>(); }
