#include "protocol/exchange.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace acopla::protocol {
namespace {

using geometry::Vec3;

// JSON would narrow a count without a word.
template <class T>
bool fits(const Body& value) {
  if (value.is_number_unsigned()) return std::in_range<T>(value.get<std::uint64_t>());
  return value.is_number_integer() && std::in_range<T>(value.get<std::int64_t>());
}

// Reads a value of a body, and says which is missing or of the wrong type.
template <class T>
T value(const Message& message, const Body& body, const char* key) {
  const auto found = body.find(key);
  try {
    if (found == body.end()) throw ProtocolError(fmt::format("{} lacks \"{}\"", name_of(message.kind), key));
    if constexpr (std::is_integral_v<T> && !std::is_same_v<T, bool>)
      if (!fits<T>(*found)) throw ProtocolError(fmt::format("\"{}\" of {} is not an integer in range", key, name_of(message.kind)));
    return found->template get<T>();
  } catch (const nlohmann::json::exception&) {
    throw ProtocolError(fmt::format("\"{}\" of {} is of the wrong type", key, name_of(message.kind)));
  }
}

// Eigen's vectors of three doubles lie one after another: they are sent as they are, and kept until they are on their way.
Array vectors(const std::string& name, const std::string& mesh, std::vector<Vec3> values) {
  static_assert(sizeof(Vec3) == 3 * sizeof(double));
  const auto count = static_cast<std::uint64_t>(values.size());
  const auto kept = std::make_shared<const std::vector<Vec3>>(std::move(values));
  return Array::view(name, mesh, ArrayType::f8, {count, 3}, kept, reinterpret_cast<const std::byte*>(kept->data()));
}

std::vector<Vec3> vectors(const Array& array) {
  if (array.shape().size() != 2 || array.shape()[1] != 3)
    throw ProtocolError(fmt::format("array {} on {} must have the shape [points, 3]", array.name(), array.mesh()));
  const auto flat = array.doubles();
  const auto* first = reinterpret_cast<const Vec3*>(flat.data());
  std::vector<Vec3> values(first, first + flat.size() / 3);
  // x − x is zero for what is finite, and NaN for the rest. Of the copy, as memory that is shared may change.
  const Eigen::Map<const Eigen::ArrayXd> all(reinterpret_cast<const double*>(values.data()), static_cast<Eigen::Index>(3 * values.size()));
  if (!((all - all).sum() == 0))
    for (std::size_t k = 0; k < values.size(); ++k)
      if (!values[k].allFinite()) throw ProtocolError(fmt::format("{} on {} is not finite at point {}", array.name(), array.mesh(), k));
  return values;
}

std::vector<Field> read_fields(const Message& message) {
  std::vector<Field> fields;
  fields.reserve(message.arrays.size());
  for (const auto& array : message.arrays) fields.push_back({array.mesh(), array.name(), vectors(array)});
  return fields;
}

const Array& array(const Message& message, const char* name, const std::string& mesh) {
  const auto* found = message.find(name, mesh);
  if (!found) throw ProtocolError(fmt::format("interface lacks the array {} of surface {}", name, mesh));
  return *found;
}

}  // namespace

Message hello_message(const std::string& participant, const Introduction& introduction) {
  Message message;
  message.kind = Kind::hello;
  message.body = {{"participant", participant},
                  {"solver", introduction.solver},
                  {"dimension", introduction.dimension},
                  {"versions", {version, version}},
                  {"capabilities", introduction.capabilities}};
  if (introduction.step > 0) message.body["step"] = introduction.step;
  return message;
}

Hello read_hello(const Message& message) {
  Hello hello;
  hello.participant = value<std::string>(message, message.body, "participant");
  hello.introduction.solver = value<std::string>(message, message.body, "solver");
  hello.introduction.dimension = value<int>(message, message.body, "dimension");
  hello.introduction.capabilities = value<std::vector<std::string>>(message, message.body, "capabilities");
  if (message.body.contains("step")) {
    hello.introduction.step = value<double>(message, message.body, "step");
    if (!(hello.introduction.step > 0) || !std::isfinite(hello.introduction.step)) throw ProtocolError("\"step\" of hello is not positive");
  }
  const auto versions = value<Body>(message, message.body, "versions");
  if (!versions.is_array() || versions.size() != 2 || !fits<std::uint64_t>(versions[0]) || !fits<std::uint64_t>(versions[1]))
    throw ProtocolError("\"versions\" of hello must be [lowest, highest]");
  hello.version_low = versions[0].get<std::uint64_t>();
  hello.version_high = versions[1].get<std::uint64_t>();
  return hello;
}

Message welcome_message(const Run& run, const std::string& pulse_endpoint, const std::optional<MemoryOffer>& memory) {
  Message message;
  message.kind = Kind::welcome;
  Body uses = Body::array();
  for (const auto& use : run.uses)
    uses.push_back({{"surface", use.surface}, {"receives", use.receives}, {"sends", use.sends}});
  message.body = {{"tick", run.tick},       {"end", run.end},         {"window", run.window},
                  {"gravity", run.gravity}, {"results", run.results}, {"uses", uses},
                  {"pulse", pulse_endpoint}};
  if (run.resumes) message.body["resumes"] = true;
  if (memory) message.body["memory"] = {{"requests", memory->requests}, {"answers", memory->answers}, {"token", memory->token}};
  if (run.wants_mass) message.body["wants_mass"] = true;
  return message;
}

Welcome read_welcome(const Message& message) {
  Welcome welcome;
  const auto& body = message.body;
  welcome.run.tick = value<double>(message, body, "tick");
  if (!(welcome.run.tick > 0) || !std::isfinite(welcome.run.tick)) throw ProtocolError("\"tick\" of welcome is not positive");
  welcome.run.end = value<std::int64_t>(message, body, "end");
  welcome.run.window = value<std::int64_t>(message, body, "window");
  const auto gravity = value<std::vector<double>>(message, body, "gravity");
  if (gravity.size() != 3) throw ProtocolError("\"gravity\" of welcome must have three components");
  std::copy(gravity.begin(), gravity.end(), welcome.run.gravity);
  welcome.run.results = value<std::string>(message, body, "results");
  for (const auto& use : value<Body>(message, body, "uses"))
    welcome.run.uses.push_back({value<std::string>(message, use, "surface"),
                                value<std::vector<std::string>>(message, use, "receives"),
                                value<std::vector<std::string>>(message, use, "sends")});
  welcome.pulse_endpoint = value<std::string>(message, body, "pulse");
  welcome.run.resumes = body.contains("resumes") && value<bool>(message, body, "resumes");
  if (body.contains("memory")) {
    const auto offer = value<Body>(message, body, "memory");
    if (!offer.is_object()) throw ProtocolError("\"memory\" of welcome is not a map");
    welcome.memory = {value<std::string>(message, offer, "requests"), value<std::string>(message, offer, "answers"),
                      value<std::uint64_t>(message, offer, "token")};
  }
  welcome.run.wants_mass = body.contains("wants_mass") && value<bool>(message, body, "wants_mass");
  return welcome;
}

Message folder_message(Kind kind, const std::string& folder) {
  Message message;
  message.kind = kind;
  message.body = {{"folder", folder}};
  return message;
}

std::string read_folder(const Message& message) { return value<std::string>(message, message.body, "folder"); }

Message interface_message(const std::vector<Surface>& surfaces, bool memory) {
  Message message;
  message.kind = Kind::interface;
  Body names = Body::array();
  for (const auto& surface : surfaces) {
    names.push_back(surface.name);
    message.arrays.push_back(vectors("points", surface.name, surface.mesh.points));
    const auto& nodes = surface.mesh.connectivity();
    message.arrays.push_back(
        Array::of("nodes", surface.name, {nodes.size()}, std::vector<std::int32_t>(nodes.begin(), nodes.end())));
    std::vector<std::uint8_t> kinds;
    for (const auto kind : surface.mesh.kinds()) kinds.push_back(static_cast<std::uint8_t>(kind));
    const std::uint64_t faces = kinds.size();  // before the move: arguments have no order
    message.arrays.push_back(Array::of("kinds", surface.name, {faces}, std::move(kinds)));
    if (!surface.displacement.empty()) message.arrays.push_back(vectors("displacement", surface.name, surface.displacement));
    if (!surface.velocity.empty()) message.arrays.push_back(vectors("velocity", surface.name, surface.velocity));
    if (!surface.mass.empty()) message.arrays.push_back(vectors("mass", surface.name, surface.mass));
  }
  message.body = {{"surfaces", names}};
  if (memory) message.body["memory"] = true;
  return message;
}

bool found_memory(const Message& interface) { return interface.body.contains("memory") && value<bool>(interface, interface.body, "memory"); }

std::vector<Surface> read_interface(const Message& message) {
  std::vector<Surface> surfaces;
  for (const auto& name : value<std::vector<std::string>>(message, message.body, "surfaces")) {
    Surface surface{name, {}, {}, {}, {}};
    surface.mesh.points = vectors(array(message, "points", name));
    const auto nodes = array(message, "nodes", name).integers();
    std::size_t first = 0;
    for (const auto kind : array(message, "kinds", name).octets()) {
      const auto count = geometry::nodes_of(static_cast<geometry::FaceKind>(kind));
      if (count == 0) throw ProtocolError(fmt::format("surface {} has a face of unknown kind {}", name, kind));
      if (first + count > nodes.size()) throw ProtocolError(fmt::format("surface {} names fewer nodes than its faces need", name));
      std::vector<std::uint32_t> face(nodes.begin() + static_cast<std::ptrdiff_t>(first),
                                      nodes.begin() + static_cast<std::ptrdiff_t>(first + count));
      try {
        surface.mesh.add_face(static_cast<geometry::FaceKind>(kind), face);
      } catch (const std::invalid_argument& error) {
        throw ProtocolError(fmt::format("surface {}: {}", name, error.what()));
      }
      first += count;
    }
    if (first != nodes.size()) throw ProtocolError(fmt::format("surface {} names more nodes than its faces need", name));
    for (const auto& [field, values] : {std::pair{"displacement", &surface.displacement}, {"velocity", &surface.velocity}, {"mass", &surface.mass}})
      if (const auto* given = message.find(field, name)) {
        *values = vectors(*given);
        if (values->size() != surface.mesh.points.size())
          throw ProtocolError(fmt::format("surface {} gives {} for {} of its {} points", name, field, values->size(), surface.mesh.points.size()));
      }
    surfaces.push_back(std::move(surface));
  }
  return surfaces;
}

Message advance_message(const Window& window, std::vector<Field> fields) {
  Message message;
  message.kind = Kind::advance;
  message.body = {{"start", window.start}, {"end", window.end}};
  if (window.estimate) message.body["estimate"] = true;
  for (auto& field : fields) message.arrays.push_back(vectors(field.name, field.surface, std::move(field.values)));
  return message;
}

AdvanceRequest read_advance(const Message& message, const std::vector<Run::Use>& uses) {
  const auto is_received = [&](const Array& array) {
    return std::any_of(uses.begin(), uses.end(), [&](const Run::Use& use) {
      return use.surface == array.mesh() && std::find(use.receives.begin(), use.receives.end(), array.name()) != use.receives.end();
    });
  };
  std::vector<Field> fields;
  for (const auto& each : message.arrays)
    if (is_received(each)) fields.push_back({each.mesh(), each.name(), vectors(each)});
  AdvanceRequest request{value<std::int64_t>(message, message.body, "start"),
                         value<std::int64_t>(message, message.body, "end"), std::move(fields),
                         message.body.contains("estimate") && value<bool>(message, message.body, "estimate")};
  if (request.start < 0 || request.end <= request.start) throw ProtocolError("advance over a window that has no length");
  return request;
}

Message advanced_message(Advance advance) {
  Message message;
  message.kind = Kind::advanced;
  message.body = {{"steps", advance.steps}};
  message.values = std::move(advance.quantities);
  for (auto& field : advance.fields) message.arrays.push_back(vectors(field.name, field.surface, std::move(field.values)));
  return message;
}

Advance read_advanced(Message message) {
  return {read_fields(message), std::move(message.values), value<std::uint64_t>(message, message.body, "steps")};
}

Message done_message(std::vector<std::pair<std::string, double>> values) {
  Message message;
  message.kind = Kind::done;
  message.values = std::move(values);
  return message;
}

Message error_message(const std::string& text, const std::string& state, bool unsupported, bool mistake) {
  Message message;
  message.kind = Kind::error;
  message.body = {{"text", text}, {"state", state}, {"unsupported", unsupported}, {"mistake", mistake}};
  return message;
}

Error read_error(const Message& message) {
  const auto text = [&](const char* key) {
    const auto found = message.body.find(key);
    return found != message.body.end() && found->is_string() ? found->get<std::string>() : std::string();
  };
  const auto flag = [&](const char* key) {
    const auto found = message.body.find(key);
    return found != message.body.end() && found->is_boolean() && found->get<bool>();
  };
  return {text("text"), text("state"), flag("unsupported"), flag("mistake")};
}

}  // namespace acopla::protocol
