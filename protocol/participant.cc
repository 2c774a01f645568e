#include "protocol/participant.h"

namespace acopla::protocol {

void Participant::save() { throw Unsupported("this solver cannot save its state"); }
void Participant::restore() { throw Unsupported("this solver cannot restore its state"); }

}  // namespace acopla::protocol
