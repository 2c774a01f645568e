// Checkpoints: the whole state of a solver in one file, from which a run is resumed bit for bit.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include "io/archive.h"

namespace acopla::io {

/// Where a state comes from.
struct CheckpointInfo {
  std::string program_version;  ///< e.g. "acopla-dem 0.1.0"
  std::string participant;      ///< its name in the case
  double time = 0;              ///< [s]
  std::int64_t ticks = 0;       ///< the same in ticks of the coupling
  std::string case_hash;        ///< of what the case says; empty where nobody asked
  bool operator==(const CheckpointInfo&) const = default;
};

/// Writes a checkpoint: 512 bytes of text with the version of this format, the byte order, the length of the file and the
/// CRC-32 of all that follows, and then an HDF5 file (whose tools skip such a block):
///   /state/NAME   one dataset per array of the state, in its order; [count], or [count, components]
///   /             attributes program_version, participant, time, ticks, case_hash
/// The same state makes the same bytes. The file is complete before it takes its name (written to PATH.part, synchronised with
/// the disk, renamed), so that a run killed meanwhile keeps the checkpoint it had.
/// @throws UserError when the file cannot be written; what was at `path` is then still there
/// @throws std::logic_error when two arrays have the same name, or one has none or holds a slash
void write_checkpoint(const std::string& path, const State& state, const CheckpointInfo& info);

/// Reads a checkpoint and its origin. The state remembers the path for messages.
/// @throws UserError when the file is not a checkpoint, of another format or byte order, cut off, or damaged by a single bit
std::pair<State, CheckpointInfo> read_checkpoint(const std::string& path);

/// A short name for a text, for CheckpointInfo::case_hash: the same on every machine, but no proof against malice (FNV-1a, 64 bits).
std::string hash_of(std::string_view text);

/// Refuses a checkpoint of another program version, participant or case. Hashes are compared where both are known.
/// @throws UserError that names both
void check_origin(const std::string& path, const CheckpointInfo& found, const CheckpointInfo& wanted);

}  // namespace acopla::io
