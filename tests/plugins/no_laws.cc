#include "dem/laws.h"

ACOPLA_LAWS(laws) { static_cast<void>(laws); }
