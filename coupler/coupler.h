// A coupled run from the first hello to the summary, in this process or among several.
#pragma once

#include <string>
#include <zmq.hpp>

#include "coupler/case.h"
#include "coupler/outcome.h"
#include "coupler/outside.h"
#include "coupler/reporter.h"
#include "protocol/keys.h"

namespace acopla::coupler {

class Coupler {
 public:
  struct Options {
    std::string endpoint;        ///< to bind: ipc://…, tcp://127.0.0.1:PORT, inproc://…
    std::string results;         ///< an existing folder; empty: nothing is written
    Outside* outside = nullptr;  ///< signals and the launcher; may be null
    bool resumes = false;        ///< goes on from the checkpoint in `results`
    const protocol::Keys* keys = nullptr;  ///< for tcp beyond loopback; may be null
  };
  /// @param context  shared with participants over inproc. Everything must outlive the coupler.
  Coupler(zmq::context_t& context, const Case& read, Options options, Reporter& reporter)
      : context_(context), case_(read), options_(std::move(options)), reporter_(reporter) {}

  /// Runs the case. Whatever happens to a participant is in the outcome, and in summary.json; the
  /// series are closed and readable. @throws io::UserError when it cannot even begin: the address
  /// is taken, the results cannot be written
  Outcome run();

 private:
  zmq::context_t& context_;
  Case case_;  // of which the windows may be known only once the participants are there
  Options options_;
  Reporter& reporter_;
};

}  // namespace acopla::coupler
