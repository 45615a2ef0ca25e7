#pragma once

#include <Eigen/Core>

#ifdef __FAST_MATH__
#error "DiracStep: compile without -ffast-math and -Ofast: the same input would no longer give the same bits"
#endif

namespace diracstep {

/// Configurations, velocities, momenta, multipliers: plain columns of doubles.
using Vector = Eigen::VectorXd;

/// How functions take a column: any contiguous column or segment, without a copy.
using ConstVectorRef = const Eigen::Ref<const Vector>&;
using VectorRef = Eigen::Ref<Vector>;

/// Several columns side by side.
using Columns = Eigen::MatrixXd;
using ConstColumnsRef = const Eigen::Ref<const Columns>&;
using ColumnsRef = Eigen::Ref<Columns>;

/// A column in extended precision, for what rounding drops from a Vector.
using ExtendedVector = Eigen::Matrix<long double, Eigen::Dynamic, 1>;

}  // namespace diracstep
