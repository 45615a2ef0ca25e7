#pragma once

#include <Eigen/Core>

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

}  // namespace diracstep
