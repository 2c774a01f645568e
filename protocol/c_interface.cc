// protocol/acopla.h on top of Session: no exception and no C++ type passes.
#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <stdexcept>

#include "protocol/acopla.h"
#include "protocol/keys.h"
#include "protocol/session.h"

using namespace acopla;
using geometry::Vec3;

struct acopla_participant {
  acopla_participant(const protocol::Introduction& introduction, const protocol::ServeOptions& options, protocol::Handlers handlers)
      : session(introduction, options, std::move(handlers)) {}

  protocol::Session session;
  std::vector<protocol::Surface> surfaces;
  protocol::Advance answer;
  std::map<std::pair<std::string, std::string>, std::vector<double>> received;  // flat, made when asked for
  enum class State { starting, ready, advancing, finishing, ended } state = State::starting;
  mutable std::string error;
};

namespace {

thread_local std::string connect_error;

// A call in the wrong place, or with an argument that cannot be: the caller's fault, which does not end the run.
void require(bool condition, const std::string& text) {
  if (!condition) throw std::logic_error(text);
}

/// Runs a call and turns whatever it throws into a sentence.
template <class Act>
int guarded(acopla_participant* p, const Act& act) {
  if (!p) return -1;
  try {
    act();
    return 0;
  } catch (const std::exception& error) {
    p->error = error.what();
  } catch (...) {
    p->error = "an exception that is not a std::exception";
  }
  return -1;
}

std::string text_of(const char* given, const char* variable, const char* what) {
  if (given) return given;
  const char* value = std::getenv(variable);
  require(value, fmt::format("no {}: {} is not set. This program is started by `acopla run`, as a case's command = […].", what, variable));
  return value;
}

const protocol::Run::Use* use_of(const acopla_participant* p, const char* surface) {
  if (!p || !surface) return nullptr;
  for (const auto& use : p->session.run().uses)
    if (use.surface == surface) return &use;
  return nullptr;
}

bool names(const std::vector<std::string>& fields, const char* field) { return field && std::find(fields.begin(), fields.end(), field) != fields.end(); }

protocol::Surface& surface_of(acopla_participant* p, const char* name) {
  require(name, "a surface without a name");
  for (auto& surface : p->surfaces)
    if (surface.name == name) return surface;
  throw std::logic_error(fmt::format("the surface {} was never offered", name));
}

std::vector<Vec3> vectors(const double* values, std::size_t count, const std::string& what) {
  require(values || count == 0, what + " is NULL");
  std::vector<Vec3> result(count);
  for (std::size_t k = 0; k < count; ++k) {
    result[k] = Vec3(values[3 * k], values[3 * k + 1], values[3 * k + 2]);
    require(result[k].allFinite(), fmt::format("{} is not finite at point {}", what, k));
  }
  return result;
}

protocol::Handlers handlers_of(const acopla_options& options) {
  const auto done = [](int code, const char* what) {
    if (code != 0) throw std::runtime_error(fmt::format("the solver could not {} (code {})", what, code));
  };
  protocol::Handlers handlers;
  void* self = options.self;
  if (options.save) handlers.save = [=, act = options.save] { done(act(self), "save its state"); };
  if (options.restore) handlers.restore = [=, act = options.restore] { done(act(self), "restore its state"); };
  if (options.checkpoint)
    handlers.checkpoint = [=, act = options.checkpoint](const std::string& folder) { done(act(self, folder.c_str()), "write a checkpoint"); };
  if (options.resume)
    handlers.resume = [=, act = options.resume](const std::string& folder) { done(act(self, folder.c_str()), "resume from a checkpoint"); };
  return handlers;
}

acopla_participant* connect(const acopla_options& options) {
  require(options.dimension == 2 || options.dimension == 3, fmt::format("dimension = {} is neither 2 nor 3", options.dimension));
  require(!options.save == !options.restore, "save and restore belong together: give both or neither");
  require(!options.checkpoint == !options.resume, "checkpoint and resume belong together: give both or neither");
  protocol::Introduction introduction{options.solver ? options.solver : "", options.dimension, {}};
  if (options.save) introduction.capabilities.emplace_back("save");
  if (options.checkpoint) introduction.capabilities.emplace_back("checkpoint");
  protocol::ServeOptions where;
  where.endpoint = text_of(options.endpoint, "ACOPLA_ENDPOINT", "address");
  where.name = text_of(options.name, "ACOPLA_PARTICIPANT", "name");
  where.keys = options.keys ? options.keys : protocol::keys_of_environment();
  return new acopla_participant(introduction, where, handlers_of(options));
}

using State = acopla_participant::State;

}  // namespace

acopla_participant* acopla_connect(const acopla_options* options) {
  try {
    require(options, "no options");
    return connect(*options);
  } catch (const std::exception& error) {
    connect_error = error.what();
  } catch (...) {
    connect_error = "an exception that is not a std::exception";
  }
  return nullptr;
}

void acopla_close(acopla_participant* p) { delete p; }
const char* acopla_error(const acopla_participant* p) { return p ? p->error.c_str() : connect_error.c_str(); }

double acopla_tick(const acopla_participant* p) { return p ? p->session.run().tick : 0; }
int64_t acopla_end(const acopla_participant* p) { return p ? p->session.run().end : 0; }
int64_t acopla_window_length(const acopla_participant* p) { return p ? p->session.run().window : 0; }
const double* acopla_gravity(const acopla_participant* p) { return p ? p->session.run().gravity : nullptr; }
const char* acopla_results(const acopla_participant* p) { return p ? p->session.run().results.c_str() : ""; }
int acopla_resumes(const acopla_participant* p) { return p && p->session.run().resumes; }
int acopla_wants_mass(const acopla_participant* p) { return p && p->session.run().wants_mass; }
size_t acopla_use_count(const acopla_participant* p) { return p ? p->session.run().uses.size() : 0; }
const char* acopla_use(const acopla_participant* p, size_t k) {
  return k < acopla_use_count(p) ? p->session.run().uses[k].surface.c_str() : nullptr;
}
int acopla_receives(const acopla_participant* p, const char* surface, const char* field) {
  const auto* use = use_of(p, surface);
  return use && names(use->receives, field);
}
int acopla_sends(const acopla_participant* p, const char* surface, const char* field) {
  const auto* use = use_of(p, surface);
  return use && names(use->sends, field);
}

int acopla_offer_surface(acopla_participant* p, const char* surface, size_t points, const double* xyz, size_t faces, const unsigned char* kinds,
                         const int32_t* nodes) {
  return guarded(p, [&] {
    require(p->state == State::starting, "surfaces are offered before acopla_ready()");
    require(surface && *surface, "a surface without a name");
    require(faces == 0 || (kinds && nodes), "kinds or nodes is NULL");
    protocol::Surface offered{surface, {}, {}, {}, {}};
    offered.mesh.points = vectors(xyz, points, fmt::format("points of {}", surface));
    for (size_t face = 0; face < faces; ++face) {
      const auto kind = static_cast<geometry::FaceKind>(kinds[face]);
      const auto count = geometry::nodes_of(kind);
      require(count > 0, fmt::format("face {} of {} is of the unknown kind {}", face, surface, kinds[face]));
      offered.mesh.add_face(kind, std::vector<std::uint32_t>(nodes, nodes + count));
      nodes += count;
    }
    p->surfaces.push_back(std::move(offered));
  });
}

int acopla_set_initial(acopla_participant* p, const char* surface, const char* field, const double* values) {
  return guarded(p, [&] {
    require(p->state == State::starting, "initial fields are set before acopla_ready()");
    auto& known = surface_of(p, surface);
    const std::string name = field ? field : "";
    auto* target = name == "displacement" ? &known.displacement : name == "velocity" ? &known.velocity : name == "mass" ? &known.mass : nullptr;
    require(target, fmt::format("\"{}\" is not an initial field. Use \"displacement\", \"velocity\" or \"mass\"", name));
    *target = vectors(values, known.mesh.points.size(), fmt::format("{} on {}", name, surface));
  });
}

int acopla_ready(acopla_participant* p) {
  return guarded(p, [&] {
    require(p->state == State::starting, "acopla_ready() was called before");
    p->session.offer(p->surfaces);
    p->state = State::ready;
  });
}

int acopla_next(acopla_participant* p, acopla_window* window) {
  bool goes_on = false;
  const int code = guarded(p, [&] {
    require(window, "window is NULL");
    require(p->state != State::advancing, "the last window was not answered: call acopla_answer() first");
    require(p->state == State::ready, "acopla_next() is called after acopla_ready() and before the end");
    protocol::Window next;
    p->state = State::ended;  // unless it goes on: a run that failed has no next window
    goes_on = p->session.next(next);
    p->state = goes_on ? State::advancing : State::finishing;
    if (!goes_on) return;
    p->received.clear();
    *window = {next.start, next.end, next.start_time, next.length, next.estimate};
  });
  return code != 0 ? -1 : goes_on;
}

const double* acopla_received(acopla_participant* p, const char* surface, const char* field) {
  if (!p || !surface || !field) return nullptr;
  for (const auto& given : p->session.received()) {
    if (given.surface != surface || given.name != field) continue;
    auto& flat = p->received[{surface, field}];
    if (flat.empty())
      for (const auto& value : given.values) flat.insert(flat.end(), value.data(), value.data() + 3);
    return flat.data();
  }
  return nullptr;
}

int acopla_send(acopla_participant* p, const char* surface, const char* field, const double* values) {
  return guarded(p, [&] {
    require(p->state == State::advancing, "fields are sent between acopla_next() and acopla_answer()");
    require(field && *field, "a field without a name");
    const auto& known = surface_of(p, surface);
    p->answer.fields.push_back({surface, field, vectors(values, known.mesh.points.size(), fmt::format("{} on {}", field, surface))});
  });
}

int acopla_report(acopla_participant* p, const char* quantity, double value) {
  return guarded(p, [&] {
    require(quantity && *quantity, "a quantity without a name");
    p->answer.quantities.emplace_back(quantity, value);
  });
}

int acopla_answer(acopla_participant* p, uint64_t steps) {
  return guarded(p, [&] {
    require(p->state == State::advancing, "acopla_answer() without a window");
    p->answer.steps = steps;
    p->session.answer(std::exchange(p->answer, {}));
    p->state = State::ready;
  });
}

int acopla_finish(acopla_participant* p) {
  return guarded(p, [&] {
    require(p->state == State::finishing, "acopla_finish() is called when acopla_next() returned 0");
    p->session.finish(std::move(p->answer.quantities));
    p->state = State::ended;
  });
}

int acopla_fail(acopla_participant* p, const char* text, int mistake) {
  return guarded(p, [&] {
    p->state = State::ended;
    p->session.fail(text && *text ? text : "the solver failed without a word", mistake != 0);
  });
}
