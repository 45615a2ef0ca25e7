#include <diracstep/core/runs/frames.hpp>

namespace diracstep {

Sample in_frames_of(ConstVectorRef q, const Sample& end, const Space* space) {
  if (space == nullptr || space->turns().empty()) return end;
  const Vector between = space->difference(q, end.q);
  if (!between.allFinite()) return end;
  const Eigen::Index d = space->group_dimension();
  Vector back = Vector::Zero(d), column(d);
  for (const int turn : space->turns()) back[turn] = -between[turn];
  Columns adjoint(d, d), adjoint_back(d, d), dtau(d, d), dtau_back(d, d);
  space->maps(back, adjoint, adjoint_back, dtau, dtau_back);
  Sample turned = end;
  turned.q = space->moved(end.q, back);
  space->embed(end.v, column);
  space->restrict(adjoint_back * column, turned.v);
  space->embed(end.p, column);
  space->restrict(adjoint.transpose() * column, turned.p);
  return turned;
}

}  // namespace diracstep
