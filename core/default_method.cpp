#include <diracstep/core/composition.hpp>
#include <diracstep/core/default_method.hpp>
#include <diracstep/core/errors.hpp>

namespace diracstep {

namespace {

constexpr int default_order = 6;
constexpr int highest_order = 40;  // GL(20)

}  // namespace

DefaultMethod default_method(const Scene& /*scene*/, int order, std::optional<StepRule> rule) {
  if (rule)
    return {"type1/midpoint", order,
            std::string("GL(s) has its own nodes for the rows; the ") + name(*rule) + " rule was asked for"};
  if (order < 0 || order > highest_order || order % 2 != 0)
    throw Misuse("order " + std::to_string(order) + " without a method: even orders up to " +
                 std::to_string(highest_order) + " are allowed; type1/left and type2/euler are of order 1");
  const bool asked = order > 0;
  const int stages = (asked ? order : default_order) / 2;
  const std::string text = "GL(" + std::to_string(stages) + "), order " + std::to_string(2 * stages);
  return {"type1/gl:" + std::to_string(stages), 2 * stages,
          text + (asked ? ", as asked for" : ": least time at errors from 1e-3 to 1e-8; order 8 below")};
}

}  // namespace diracstep
