#include "protocol/participant.h"

namespace acopla::protocol {

void Participant::save() { throw Unsupported("this solver cannot save its state"); }
void Participant::restore() { throw Unsupported("this solver cannot restore its state"); }
void Participant::checkpoint(const std::string&) { throw Unsupported("this solver cannot write a checkpoint"); }
void Participant::resume(const std::string&) { throw Unsupported("this solver cannot resume from a checkpoint"); }

}  // namespace acopla::protocol
