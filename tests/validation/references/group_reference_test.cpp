#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/validation/references/explicit_reference.hpp>
#include <diracstep/validation/references/group_lagrangian_dae.hpp>
#include <diracstep/validation/references/ida_reference.hpp>
#include <diracstep/validation/studies/study_run.hpp>

#include "differences.hpp"
#include "group_stepping.hpp"
#include "methods.hpp"
#include "scenes.hpp"

/// IDA and the explicit reference on groups and spheres, beside equations written by hand that share nothing
/// with the library.
namespace diracstep {
namespace {

using group_scenes::GroupScene;

class GroupReference : public ::testing::TestWithParam<GroupScene> {};

/// Along the space: moves of q by B x.
TEST_P(GroupReference, JacobianAgreesWithDifferences) {
  const Scene& scene = *GetParam().scene;
  const Eigen::Index numbers = scene.storage_size(), n = scene.dimension();
  for (const DaeFormulation formulation : formulations_of(scene)) {
    GroupLagrangianDae dae(scene, formulation);
    constexpr double t = 0.3, cj = 1.7;
    Vector y(dae.size()), rate(dae.size());
    for (Eigen::Index i = 0; i < y.size(); ++i) {
      y[i] = 0.3 + 0.5 * std::sin(1.0 + 3.0 * static_cast<double>(i));
      rate[i] = 0.7 * std::cos(2.0 + 5.0 * static_cast<double>(i));
    }
    y.head(numbers) = scene.space->normalised(y.head(numbers));
    Columns moves = Columns::Zero(dae.size(), dae.size() - numbers + n);
    moves.topLeftCorner(numbers, n) = scene.space->tangent_basis(y.head(numbers));
    moves.bottomRightCorner(dae.size() - numbers, dae.size() - numbers).setIdentity();
    const auto shifted = [&](const Vector& x) {
      Vector f(dae.size());
      dae.residual(t, y + moves * x, rate + cj * (moves * x), f);
      return f;
    };
    Vector values(dae.pattern().nonzeros());
    dae.jacobian(t, cj, y, rate, values);
    const Eigen::MatrixXd expected = testing::difference_jacobian(shifted, Vector::Zero(moves.cols()));
    EXPECT_LT((dae.pattern().full(values) * moves - expected).cwiseAbs().maxCoeff(), 1e-7)
        << scene.name << ' ' << name(formulation);
  }
}

TEST_P(GroupReference, MeetsEquationsWrittenByHand) {
  constexpr double T = 2.0, rtol = 1e-10;
  const GroupScene& of = GetParam();
  const Vector reference = group_scenes::reference(of, T);
  for (const DaeFormulation formulation : formulations_of(*of.scene)) {
    const ReferenceRun ida = integrate_with_ida(*of.scene, T, {.rtol = rtol, .formulation = formulation});
    ASSERT_TRUE(ida.ok()) << name(formulation) << ": " << ida.failure;
    EXPECT_LT((of.observe(ida.end.q, ida.end.v) - reference).lpNorm<Eigen::Infinity>(), 1e-6)
        << name(formulation);
    EXPECT_LT(ida.off_space, 1e-7);
    EXPECT_LT(ida.newton_iterations, 4 * ida.steps) << "the Jacobian is not that of the residual";
  }
  const ReferenceRun erk = integrate_explicitly(*of.scene, T, {.rtol = rtol});
  ASSERT_TRUE(erk.ok()) << erk.failure;
  EXPECT_LT((of.observe(erk.end.q, erk.end.v) - reference).lpNorm<Eigen::Infinity>(), 1e-8);
  EXPECT_LT(erk.off_space, 1e-8);
}

INSTANTIATE_TEST_SUITE_P(Scenes, GroupReference, ::testing::ValuesIn(group_scenes::all_scenes()),
                         [](const auto& of) { return testing::test_name(of.param.name); });

TEST(GroupReferenceOfTheCatalogue, IdaMeetsTheReferenceOfEveryScene) {
  int scenes = 0;
  for (const std::string& name : scene_names()) {
    const CatalogueScene entry = make_scene(name);
    if (!entry.scene->space) continue;
    ++scenes;
    const auto known = known_point(entry, entry.t_end);
    ASSERT_TRUE(known) << name << ": its reference is not whole";
    const ReferenceRun ida = integrate_with_ida(*entry.scene, entry.t_end, {.rtol = 1e-11});
    ASSERT_TRUE(ida.ok()) << name << ": " << ida.failure;
    EXPECT_LT(known->distance(ida.end), name == "heavy_top_so3" ? 1e-4 : 1e-6) << name;  // at 150 rad/s
  }
  EXPECT_EQ(scenes, 10);
}

/// Frames of a sphere turn about their point, which is no difference of two ends; where they point is.
TEST(FramesOfSpheres, AreTurnedToThoseOfTheReference) {
  const std::shared_ptr<const Scene> sphere = group_scenes::all_scenes().back().scene;
  const Scene& scene = *sphere;
  ASSERT_FALSE(scene.space->turns().empty());
  Sample here, turned;
  here.q = scene.start.q;
  here.v = scene.start.v;
  here.p = 2.0 * scene.start.v;
  const double angle = 0.3;
  turned = here;
  turned.q = scene.space->moved(here.q, Vector(angle * Vector::Unit(3, 2)));
  const Eigen::Matrix2d back = Eigen::Rotation2Dd(-angle).toRotationMatrix();
  turned.v = back * here.v;
  turned.p = back * here.p;
  ReferenceEnd reference{
      .kind = {}, .how = {}, .missing = {}, .q = here.q, .p = here.p, .space = scene.space};
  EXPECT_LT(reference.distance(turned), 1e-14);
  turned.q = scene.space->moved(turned.q, Vector((Vector(3) << 1e-3, 0.0, 0.0).finished()));
  EXPECT_GT(reference.distance(turned), 2e-4);
}

}  // namespace
}  // namespace diracstep
