#include <diracstep/plugins/diracstep_plugin.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/plugins/callback_error.hpp>
#include <diracstep/plugins/loaded_plugin.hpp>
#include <diracstep/plugins/shared_object.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <filesystem>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <vector>

/// libFuzzer's entry.  The bytes are once a file that claims to be a plugin, which is examined and, where it
/// is damaged, refused; and once the choices in the description of a plugin: what is NULL, what has which
/// size, what a callback answers.  It is refused with a message, or its methods and scenes take steps, which
/// may fail and throw CallbackError.  What no host can find out is left out: a pointer that is neither NULL
/// nor valid, an array shorter than its count.
namespace {

using namespace diracstep;

/// Choices, one byte after the other; 0 after the last, which always means what is right.
class Choices {
 public:
  Choices(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}
  int next() {
    if (size_ == 0) return 0;
    --size_;
    return *data_++;
  }
  /// Mostly `right`: one of eight choices is another.
  template <class T, std::size_t N>
  T value(T right, const std::array<T, N>& others) {
    const int choice = next();
    return choice % 8 == 7 ? others[static_cast<std::size_t>(choice / 8) % N] : right;
  }
  int number(int right) {
    return value(right, std::array{-1, 0, 1, 2, 5, 100, std::numeric_limits<int>::max(),
                                   std::numeric_limits<int>::min()});
  }
  template <class T>
  T* pointer(T* right) {
    return value(right, std::array<T*, 1>{nullptr});
  }
  double real(double right) {
    return value(right, std::array{std::nan(""), HUGE_VAL, -1.0, 0.0, 1e300, 1e-300, -right});
  }

 private:
  const std::uint8_t* data_;
  std::size_t size_;
};

/// What a callback answers, by its data pointer; the counters let it go wrong late.
struct Answer {
  int kind = 0;  ///< 0 right, 1 NaN, 2 an error, 3 throws, 4 infinite, 5 throws what is no exception
  int first = 0, calls = 0;
  int dimension = 2;
};

/// After so many calls every answer is an error: retries of a step that has no solution take most of the
/// time.
constexpr int max_calls = 400;

int answer(const void* data, std::initializer_list<double*> columns, int size) {
  Answer& how = *static_cast<Answer*>(const_cast<void*>(data));
  if (how.calls++ < how.first) return 0;
  if (how.calls > max_calls) return 42;
  switch (how.kind) {
    case 1:
    case 4:
      for (double* column : columns) std::fill_n(column, size, how.kind == 1 ? std::nan("") : HUGE_VAL);
      return 0;
    case 2:
      return 42;
    case 3:
      throw std::runtime_error("thrown");
    case 5:
      throw 5;
    default:
      return 0;
  }
}

int lagrangian(const void* data, double, const double* q, const double* v, double* l) {
  *l = 0.0;
  for (int i = 0; i < static_cast<const Answer*>(data)->dimension; ++i)
    *l += 0.5 * (v[i] * v[i] - q[i] * q[i]);
  return answer(data, {l}, 1);
}
int lagrangian_gradient(const void* data, double, const double* q, const double* v, double* lq, double* lv) {
  const int n = static_cast<const Answer*>(data)->dimension;
  for (int i = 0; i < n; ++i) lq[i] = -q[i], lv[i] = v[i];
  return answer(data, {lq, lv}, n);
}
int position(const void* data, double t, const double* q, double* phi) {
  *phi = q[0] - t;
  return answer(data, {phi}, 1);
}
int coefficients(const void* data, double, const double* q, double* a, double* b) {
  *b = -1.0;
  std::fill_n(a, static_cast<const Answer*>(data)->dimension, 0.0);
  a[0] = 1.0 + q[0] * 0.0;
  return answer(data, {b}, 1);
}
int force(const void* data, double, const double*, const double* v, double* f) {
  const int n = static_cast<const Answer*>(data)->dimension;
  for (int i = 0; i < n; ++i) f[i] = -0.1 * v[i];
  return answer(data, {f}, n);
}
int create(const void* data, const diracstep_system*, void** self) {
  *self = const_cast<void*>(data);
  return answer(data, {}, 0);
}
void destroy(void*) {}
const char* error_text(void*, int status) { return status == 42 ? "refused" : nullptr; }

/// S = h L at the middle, whatever the type: what the type says of it is then a lie that a step survives.
int method_value(void* self, const diracstep_system* system, diracstep_interval step, const double* y,
                 double* s) {
  const int n = system->dimension;
  std::vector<double> q(static_cast<std::size_t>(n)), v(q);
  for (std::size_t i = 0; i < q.size(); ++i) {
    q[i] = 0.5 * (y[i] + y[q.size() + i]);
    v[i] = (y[q.size() + i] - y[i]) / step.size;
  }
  const auto& l = system->lagrangian;
  const int status = l.value(l.data, step.start, q.data(), v.data(), s);
  *s *= step.size;
  if (status != 0 || self == nullptr) return status;
  return answer(self, {s}, 1);
}

/// A description with all that it points to.
struct Description {
  explicit Description(Choices c) {
    takes_steps = c.next() % 32 == 0;
    for (Answer& a : answers) {
      a.kind = c.next() % 12;
      a.first = c.next() % 64;
      a.dimension = 1 + dimension_choice(c);
    }
    for (Answer& a : answers) a.dimension = answers[0].dimension;
    const int n = answers[0].dimension;
    describe_scene(c, n);
    describe_method(c);
    nodes = {c.real(0.5), c.real(1.0)};
    weights = {c.real(1.0), c.real(0.0)};
    rule = {c.pointer("centre"), c.value(1, std::array{-1, 0, 2}), c.pointer(nodes.data()),
            c.pointer(weights.data())};
    plugin = {c.value(DIRACSTEP_PLUGIN_VERSION, std::array{0u, 2u, ~0u}),
              c.value(static_cast<unsigned>(sizeof(diracstep_plugin)), std::array{0u, 8u, ~0u}),
              c.pointer("mine"),
              c.pointer("a plugin"),
              c.value(1, std::array{-1, 0, 2}),
              c.pointer(methods.data()),
              c.value(1, std::array{-1, 0, 2}),
              c.pointer(rules.data()),
              c.value(1, std::array{-1, 0, 2}),
              c.pointer(scenes.data())};
    for (std::size_t k = 0; k < 2; ++k) {
      methods[k] = c.pointer(&method);
      rules[k] = c.pointer(&rule);
      scenes[k] = c.pointer(&scene);
    }
  }
  Description(const Description&) = delete;
  Description& operator=(const Description&) = delete;

  static int dimension_choice(Choices& c) { return c.next() % 3; }

  void describe_scene(Choices& c, int n) {
    column_starts = {0, 1, 2, 3};
    row_indices = {0, 1, 2};
    for (int& start : column_starts) start = c.number(start);
    for (int& row : row_indices) row = c.number(row);
    // Starts beyond the array are a lie that cannot be found out where the entries before them fit.
    for (int& start : column_starts) start = std::min(start, 3);
    const diracstep_pattern pattern{c.next() % 2 == 0 ? nullptr : column_starts.data(),
                                    c.pointer(row_indices.data())};
    function = {&answers[0],
                pattern,
                c.value(0, std::array{1, 2, 4, 7, 8, 16, 31, -1}),
                c.pointer(&lagrangian),
                c.next() % 2 == 0 ? nullptr : &lagrangian_gradient,
                nullptr};
    row_name = {c.pointer("held")};
    rows = {&answers[1],
            c.value(1, std::array{-1, 0}),
            c.next() % 2,
            c.pointer(row_name.data()),
            {nullptr, nullptr},
            c.pointer(&position),
            c.pointer(&coefficients)};
    row_blocks = {c.pointer(&rows), c.pointer(&rows)};
    forces = {&answers[2], {nullptr, nullptr}, c.pointer(&force)};
    for (double& x : start_q) x = c.real(0.0);
    for (double& x : start_v) x = c.real(1.0);
    for (auto& name : coordinates) name = c.pointer("x");
    scene = {c.pointer("mine"),
             nullptr,
             c.value(n, std::array{-1, 0}),
             c.next() % 2 == 0 ? nullptr : coordinates.data(),
             c.pointer(&function),
             c.value(c.next() % 2, std::array{-1, 2}),
             c.pointer(row_blocks.data()),
             c.next() % 2 == 0 ? nullptr : &forces,
             c.real(0.0),
             c.pointer(start_q.data()),
             c.pointer(start_v.data()),
             c.real(1.0),
             c.real(0.1)};
  }

  void describe_method(Choices& c) {
    const int type = 1 + c.next() % 4;
    static const std::array<const char*, 4> names{"type1/mine", "type2/mine", "type3/mine", "type4/mine"};
    method = {};
    method.name = c.pointer(c.value(names[static_cast<std::size_t>(type - 1)],
                                    std::array<const char*, 4>{"type1/midpoint", "", "typ", "type1/a b"}));
    method.type = c.number(type);
    method.order = c.number(2);
    method.constrained_order = c.number(0);
    method.flags = c.next();
    method.constraint_rule =
        c.next() % 2 == 0 ? nullptr : c.value("centre", std::array<const char*, 2>{"left", "?"});
    method.adjoint = c.next() % 4 == 0 ? "type1/left" : nullptr;
    method.inner_columns = c.value(0, std::array{-1, 1, 2, std::numeric_limits<int>::max()});
    method.data = &answers[3];
    method.create = c.pointer(&create);
    method.destroy = c.pointer(&destroy);
    method.value = c.pointer(&method_value);
    method.error_text = c.pointer(&error_text);
  }

  bool takes_steps = true;  ///< which takes most of the time
  std::array<Answer, 4> answers{};
  std::array<int, 4> column_starts{};
  std::array<int, 3> row_indices{};
  std::array<const char*, 1> row_name{};
  std::array<const char*, 3> coordinates{};
  std::array<double, 3> start_q{}, start_v{};
  std::array<double, 2> nodes{}, weights{};
  diracstep_function function{};
  diracstep_rows rows{};
  diracstep_force forces{};
  diracstep_scene scene{};
  diracstep_method method{};
  diracstep_rule rule{};
  diracstep_plugin plugin{};
  std::array<const diracstep_rows*, 2> row_blocks{};
  std::array<const diracstep_method*, 2> methods{};
  std::array<const diracstep_rule*, 2> rules{};
  std::array<const diracstep_scene*, 2> scenes{};
};

template <class Action>
void refusable(Action action) {
  try {
    action();
  } catch (const Misuse& refused) {
    if (*refused.what() == '\0') std::abort();
  } catch (const CallbackError& error) {
    if (*error.what() == '\0') std::abort();
  }
}

void take_steps(const Registry& registry, const PluginScene& that, const std::string& method) {
  refusable([&] {
    Integrator integrator(that.scene, registry, kinsol(), {.method = method, .step = that.step});
    Sample sample;
    for (int k = 0; k < 3 && integrator.step().ok(); ++k)
      if (!integrator.sample(Momentum::projected, sample).ok()) break;
  });
}

void use(const Description& description) {
  static const Registry built_ins = Registry::with_built_ins();
  refusable([&] {
    const Plugin plugin(&description.plugin);
    Registry registry = built_ins;
    plugin.add_to(registry);
    for (const std::string& name : plugin.scenes()) {
      const PluginScene scene = plugin.scene(name);
      if (!description.takes_steps) continue;
      take_steps(registry, scene, "type1/midpoint");
      for (const std::string& method : plugin.methods()) take_steps(registry, scene, method);
    }
  });
}

const std::string& scratch_file() {
  static const std::string path =
      (std::filesystem::temp_directory_path() / ("diracstep_fuzz_" + std::to_string(getpid()))).string();
  static const int removal = std::atexit([] { std::filesystem::remove(scratch_file()); });
  if (removal != 0) std::abort();
  return path;
}

/// A whole object is not opened: that would run what is in it.
void examine(const std::uint8_t* data, std::size_t size) {
  std::ofstream(scratch_file(), std::ios::binary)
      .write(reinterpret_cast<const char*>(data), static_cast<std::streamsize>(size));
  if (damage_of(scratch_file()).empty()) return;
  try {
    load_plugin(scratch_file());
    std::abort();
  } catch (const Misuse&) {  // as it must be
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  examine(data, size);
  const Description description(Choices(data, size));
  use(description);
  return 0;
}
