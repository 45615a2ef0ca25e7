#include <gtest/gtest.h>

#include <deque>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/plugins/callback_scene.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>

/// A scene given by values alone moves alike in all units: derivatives by differences follow the coordinates.
namespace diracstep::testing {
namespace {

/// Factors of lengths, masses and times: numbers in the new unit over those in the old one.
struct Units {
  double length = 1.0, mass = 1.0, time = 1.0;
  double energy() const { return mass * length * length / (time * time); }
  double speed() const { return length / time; }
};

/// A scene in other units as callbacks that give values only.
class InUnits {
 public:
  InUnits(std::shared_ptr<const Scene> scene, double step, double end, Units units)
      : scene_(completed(std::move(scene))), units_(units) {
    const int n = scene_->dimension();
    q_ = units.length * scene_->start.q;
    v_ = units.speed() * scene_->start.v;
    lagrangian_.data = this;
    lagrangian_.value = [](const void* data, double t, const double* x, const double* y, double* f) {
      const InUnits& self = *static_cast<const InUnits*>(data);
      *f = self.units_.energy() *
           self.scene_->lagrangian->value(t / self.units_.time, self.position(x), self.velocity(y));
      return 0;
    };
    force_.data = this;
    force_.value = [](const void* data, double t, const double* x, const double* y, double* f) {
      const InUnits& self = *static_cast<const InUnits*>(data);
      Vector value = Vector::Zero(self.scene_->dimension());
      self.scene_->force->value(t / self.units_.time, self.position(x), self.velocity(y), value);
      Eigen::Map<Vector>(f, value.size()) = self.units_.energy() / self.units_.length * value;
      return 0;
    };
    for (const auto& block : scene_->constraints) add(*block);
    for (const diracstep_rows& rows : rows_) list_.push_back(&rows);
    c_.name = "in other units";
    c_.dimension = n;
    c_.lagrangian = &lagrangian_;
    c_.row_blocks = static_cast<int>(list_.size());
    c_.rows = list_.data();
    c_.force = scene_->force ? &force_ : nullptr;
    c_.start_time = units.time * scene_->start.time;
    c_.start_q = q_.data();
    c_.start_v = v_.data();
    c_.step = units.time * step;
    c_.end_time = units.time * end;
  }
  InUnits(const InUnits&) = delete;
  InUnits& operator=(const InUnits&) = delete;

  /// The end of so many steps, in the old units, and the doubt of the differences.
  Sample end(long steps, std::string& doubt) const {
    const auto made = std::make_shared<const Scene>(scene_from(c_, "test"));
    Integrator integrator(made, Registry::with_built_ins(), kinsol(),
                          {.method = "type1/gl:3", .step = c_.step});
    for (long k = 0; k < steps; ++k) {
      const StepReport report = integrator.step();
      EXPECT_TRUE(report.ok()) << report.failure;
      if (!report.ok()) break;
    }
    Sample end;
    EXPECT_TRUE(integrator.sample(Momentum::projected, end).ok());
    doubt = made->doubt();
    end.q /= units_.length;
    end.v /= units_.speed();
    end.energy /= units_.energy();
    return end;
  }

 private:
  struct Block {
    const InUnits* self;
    const ConstraintRows* rows;
  };

  Vector position(const double* x) const {
    return Eigen::Map<const Vector>(x, scene_->dimension()) / units_.length;
  }
  Vector velocity(const double* y) const {
    return Eigen::Map<const Vector>(y, scene_->dimension()) / units_.speed();
  }
  void add(const ConstraintRows& block) {
    blocks_.push_back({this, &block});
    diracstep_rows rows{};
    rows.data = &blocks_.back();
    rows.rows = block.rows();
    rows.holonomic = block.holonomic() ? 1 : 0;
    rows.position = [](const void* data, double t, const double* q, double* phi) {
      const Block& b = *static_cast<const Block*>(data);
      Vector value(b.rows->rows());
      b.rows->position(t / b.self->units_.time, b.self->position(q), value);
      Eigen::Map<Vector>(phi, value.size()) = b.self->units_.length * value;
      return 0;
    };
    if (!block.holonomic())
      rows.coefficients = [](const void* data, double t, const double* q, double* a, double* offset) {
        const Block& b = *static_cast<const Block*>(data);
        Vector values(b.rows->pattern().nonzeros()), value(b.rows->rows());
        b.rows->coefficients(t / b.self->units_.time, b.self->position(q), values, value);
        const Columns full = b.rows->pattern().full(values);
        Eigen::Map<Columns>(a, full.rows(), full.cols()) = full;
        Eigen::Map<Vector>(offset, value.size()) = b.self->units_.speed() * value;
        return 0;
      };
    rows_.push_back(rows);
  }

  std::shared_ptr<const Scene> scene_;
  Units units_;
  Vector q_, v_;
  diracstep_function lagrangian_{};
  diracstep_force force_{};
  std::deque<Block> blocks_;
  std::deque<diracstep_rows> rows_;
  std::vector<const diracstep_rows*> list_;
  diracstep_scene c_{};
};

/// Over all scenes of so many coordinates and rows; the number of them.
int sweep(int largest, long steps) {
  int scenes = 0;
  for (const std::string& name : scene_names()) {
    const CatalogueScene entry = make_scene(name);
    const Scene& scene = *entry.scene;
    if (!entry.needs.empty() || scene.dimension() + scene.rows() > largest) continue;
    if (completed(entry.scene)->lagrangian->structure().y_hessian_zero) continue;
    if (scene.space || entry.scene->kinks || !entry.events.empty())
      continue;  // of which a plugin tells nothing
    ++scenes;
    SCOPED_TRACE(name);

    std::string doubt;
    const double step = 0.5 * entry.natural_step;
    const Sample in_own = InUnits(entry.scene, step, entry.t_end, {}).end(steps, doubt);
    EXPECT_EQ(doubt, "") << name;
    for (const Units units : {Units{.length = 1e6}, Units{.length = 1e-6}, Units{.mass = 1e6},
                              Units{.mass = 1e-6}, Units{.time = 1e6}, Units{.time = 1e-6}}) {
      const Sample end = InUnits(entry.scene, step, entry.t_end, units).end(steps, doubt);
      const std::string what = name + ", length " + std::to_string(units.length) + ", mass " +
                               std::to_string(units.mass) + ", time " + std::to_string(units.time);
      EXPECT_LT((end.q - in_own.q).lpNorm<Eigen::Infinity>(), 1e-8 * in_own.q.lpNorm<Eigen::Infinity>())
          << what;
      EXPECT_LT((end.v - in_own.v).lpNorm<Eigen::Infinity>(), 1e-7 * in_own.v.lpNorm<Eigen::Infinity>())
          << what;
      EXPECT_EQ(doubt, "") << what;
    }
  }
  return scenes;
}

TEST(Units, GiveTheSameDigitsOnSmallScenes) { EXPECT_GE(sweep(3, 6), 2); }
/// Some hundred runs, all of whose second derivatives are differences of differences.
TEST(Units, GiveTheSameDigitsOverTheCatalogue_slow) { EXPECT_GE(sweep(12, 20), 5); }

}  // namespace
}  // namespace diracstep::testing
