#include <diracstep/reports/build_facts.hpp>
#include <diracstep/reports/report.hpp>
#include <diracstep/reports/study_json.hpp>
#include <optional>

namespace diracstep {

namespace {

Json number(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

Json row_json(const StudyRow& row, Momentum momentum) {
  Json json{{"method", row.method}};
  if (row.is_baseline()) {
    json["rtol"] = row.rtol;
    if (!row.formulation.empty()) json["formulation"] = row.formulation;
  } else {
    json["order"] = row.order;
    json["momentum"] = name(momentum);
    json["step"] = number(row.step);
  }
  json["status"] = row.status;
  json["error_q"] = number(row.error_q);
  json["error_p"] = number(row.error_p);
  if (row.is_baseline()) json["self_error"] = number(row.self_error);
  json["constraint"] = number(row.constraint);
  json["energy_error"] = number(row.energy_error);
  const CpuSeconds& cpu = row.cpu_seconds;
  const bool timed = cpu.repeats > 0;
  json["cpu_seconds"] = {{"median", timed ? number(cpu.median) : Json(nullptr)},
                         {"min", timed ? number(cpu.min) : Json(nullptr)},
                         {"max", timed ? number(cpu.max) : Json(nullptr)},
                         {"repeats", cpu.repeats}};
  json["steps"] = row.steps;
  json["newton_iterations"] = row.newton_iterations;
  json["residual_evaluations"] = row.residual_evaluations;
  json["jacobian_evaluations"] = row.jacobian_evaluations;
  return json;
}

Json measured_json(const MeasuredOrder& measured) {
  return {{"method", measured.method},
          {"order", measured.order},
          {"slope", number(measured.slope)},
          {"points", measured.points},
          {"ladder_end", measured.ladder_end.empty() ? Json(nullptr) : Json(measured.ladder_end)}};
}

Json at_error_json(const AtError& at) {
  return {{"error", at.error},
          {"method", at.method},
          {"order", at.order},
          {"best", at.best},
          {"cpu_seconds", number(at.cpu_seconds)},
          {"ida_cpu_seconds", number(at.ida_cpu_seconds)},
          {"ratio", number(at.ratio)},
          {"erk_cpu_seconds", number(at.erk_cpu_seconds)},
          {"erk_ratio", number(at.erk_ratio)}};
}

Json study_json(const Study& study) {
  Json json{{"scene", study.scene},
            {"parameters", Json::object()},
            {"t_start", study.t_start},
            {"t_end", study.t_end},
            {"unknowns", study.unknowns},
            {"momentum", name(study.momentum)},
            {"interrupted", study.interrupted}};
  for (const auto& [key, value] : study.parameters) json["parameters"][key] = number(value);
  json["reference"] = {{"kind", study.reference_kind},
                       {"how", study.reference_how},
                       {"self_error", number(study.reference_error)}};
  for (const char* list : {"rows", "measured_order", "at_error"}) json[list] = Json::array();
  for (const StudyRow& row : study.rows) json["rows"].push_back(row_json(row, study.momentum));
  for (const MeasuredOrder& m : study.measured_orders) json["measured_order"].push_back(measured_json(m));
  for (const AtError& at : study.at_error) json["at_error"].push_back(at_error_json(at));
  return json;
}

}  // namespace

Json studies_document(const std::vector<Study>& studies) {
  Json json{{"studies", Json::array()}, {"build", Json::object()}};
  for (const auto& [key, value] : build_facts()) json["build"][key] = value;
  for (const Study& study : studies) json["studies"].push_back(study_json(study));
  return json;
}

std::string studies_json(const std::vector<Study>& studies) { return to_text(studies_document(studies), 2); }

}  // namespace diracstep
