// Between the structures of C++ and the messages of the protocol: one place for each body's layout (docs/protocol.md, §4).
#pragma once

#include <optional>

#include "protocol/participant.h"
#include "protocol/shared_memory.h"

namespace acopla::protocol {

Message hello_message(const std::string& participant, const Introduction& introduction);
struct Hello {
  std::string participant;
  Introduction introduction;
  std::uint64_t version_low = 0, version_high = 0;
};
Hello read_hello(const Message& message);

Message welcome_message(const Run& run, const std::string& pulse_endpoint, const std::optional<MemoryOffer>& memory = {});
struct Welcome {
  Run run;
  std::string pulse_endpoint;
  std::optional<MemoryOffer> memory;
};
Welcome read_welcome(const Message& message);

/// @param memory  the memory that was offered is there
Message interface_message(const std::vector<Surface>& surfaces, bool memory = false);
/// @return whether the participant has found the memory that it was offered
bool found_memory(const Message& interface);
std::vector<Surface> read_interface(const Message& message);

/// `checkpoint` or `resume`.
Message folder_message(Kind kind, const std::string& folder);
std::string read_folder(const Message& message);

Message advance_message(const Window& window, std::vector<Field> fields);
struct AdvanceRequest {
  std::int64_t start = 0, end = 0;
  std::vector<Field> fields;
  bool estimate = false;
};
/// Reads the fields that `uses` names as received, and passes over every other array (docs/protocol.md, §7).
AdvanceRequest read_advance(const Message& message, const std::vector<Run::Use>& uses);

Message advanced_message(Advance advance);
Advance read_advanced(Message message);

/// An answer without fields: `done`, with scalar values.
Message done_message(std::vector<std::pair<std::string, double>> values = {});

/// `unsupported` tells a kind that this participant cannot do from a failure; `mistake` a user's mistake, whose text is a
/// located sentence, from both.
Message error_message(const std::string& text, const std::string& state, bool unsupported = false, bool mistake = false);
struct Error {
  std::string text, state;
  bool unsupported = false, mistake = false;
};
/// Never throws: what an error lacks stays empty.
Error read_error(const Message& message);

}  // namespace acopla::protocol
