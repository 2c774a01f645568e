#include "coupler/outcome.h"

namespace acopla::coupler {
namespace {

using Json = nlohmann::ordered_json;

Json expectations_of(const Outcome& outcome) {
  Json list = Json::array();
  for (const auto& checked : outcome.expectations) {
    const auto& expectation = checked.expectation;
    list.push_back({{"name", expectation.name},
                    {"value", checked.value ? Json(*checked.value) : Json(nullptr)},
                    {"expected", expectation.value},
                    {"error", checked.value ? Json(checked.error) : Json(nullptr)},
                    {"tolerance", expectation.tolerance},
                    {"relative", expectation.relative},
                    {"met", checked.met},
                    {"source", expectation.source}});
  }
  return list;
}

Json participants_of(const Outcome& outcome) {
  Json map = Json::object();
  for (const auto& participant : outcome.participants)
    map[participant.name] = {{"solver", participant.solver},
                             {"seconds", participant.seconds},
                             {"seconds_waiting", participant.seconds_waiting},
                             {"steps", participant.steps},
                             {"peak_bytes", participant.peak_bytes},
                             {"processes", participant.processes}};
  return map;
}

Json summary_of(const Outcome& outcome) {
  return {
      {"schema", 1},
      {"case", outcome.title},
      {"status", name_of(outcome.status)},
      {"time", {{"end", outcome.end}, {"reached", outcome.reached}, {"windows", outcome.windows}}},
      {"expectations", expectations_of(outcome)},
      {"ledgers",
       {{"force_loss", outcome.ledgers.force_loss},
        {"moment_loss", outcome.ledgers.moment_loss},
        {"energy_made", outcome.ledgers.energy_made},
        {"iterations", outcome.ledgers.iterations},
        {"most_iterations", outcome.ledgers.most_iterations},
        {"not_converged", outcome.ledgers.not_converged},
        {"jumped", outcome.ledgers.jumped},
        {"unmapped", outcome.ledgers.unmapped},
        {"worst_distance", outcome.ledgers.worst_distance}}},
      {"participants", participants_of(outcome)},
      {"seconds", outcome.seconds},
      {"seconds_windows", outcome.seconds_windows},
      {"error", outcome.error ? Json{{"participant", outcome.error->participant},
                                     {"state", outcome.error->state},
                                     {"message", outcome.error->message}}
                              : Json(nullptr)}};
}

}  // namespace

std::string_view name_of(Status status) {
  switch (status) {
    case Status::met:
      return "met";
    case Status::missed:
      return "missed";
    case Status::failed:
      return "failed";
    case Status::interrupted:
      return "interrupted";
  }
  return "failed";
}

std::string dump(const nlohmann::ordered_json& json, int indent) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}

std::string summary_text(const Outcome& outcome) { return dump(summary_of(outcome), 2) + "\n"; }

nlohmann::ordered_json to_json(const Outcome& outcome) {
  auto json = summary_of(outcome);
  json["exit_code"] = outcome.exit_code;
  json["interfaces"] = Json::array();
  for (const auto& interface : outcome.interfaces)
    json["interfaces"].push_back(
        {{"name", interface.name},
         {"sent", {interface.sent[0], interface.sent[1], interface.sent[2]}},
         {"received", {interface.received[0], interface.received[1], interface.received[2]}},
         {"loss", interface.loss},
         {"worst_loss", interface.worst_loss}});
  json["quantities"] = Json::array();
  for (const auto& [name, value] : outcome.quantities) json["quantities"].push_back({name, value});
  for (const auto& participant : outcome.participants)
    json["participants"][participant.name]["seconds_starting"] = participant.seconds_starting;
  return json;
}

}  // namespace acopla::coupler
