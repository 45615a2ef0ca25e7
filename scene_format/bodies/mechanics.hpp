#pragma once

#include <diracstep/scene_format/bodies/mechanism.hpp>
#include <map>
#include <set>
#include <string>
#include <vector>

namespace diracstep::bodies {

/// Where a body is: x = at + turn·b for the point b of the body.
struct Pose {
  Vec at = zero_vector();
  Matrix turn = unit_matrix();

  Vec point(const Vec& b) const { return at + turn * b; }
  Vec of_point(const Vec& x) const { return transposed(turn) * (x - at); }
  Vec of_direction(const Vec& d) const { return transposed(turn) * d; }
};

/// Builds the texts of a plain scene.
class Mechanics {
 public:
  explicit Mechanics(const Mechanism& mechanism) : mechanism_(mechanism) {}
  Expansion expand();

 private:
  struct Frame {
    Pose now, start;
    Rotation::Quaternion orientation = {1.0, 0.0, 0.0, 0.0};  ///< at the start
    Vec rate = zero_vector();                                 ///< in the body
    Vec rate_in_space = zero_vector();
    Formula angle = 0.0;  ///< in the plane
    bool held = false;    ///< by a joint or a contact
  };

  // mechanics.cpp
  void add_frames();
  void add_plane_body(const Body& body, Frame& frame);
  void add_body(const Body& body, Frame& frame);
  void add_start(const Body& body, const Frame& frame);
  void add_spring(const Spring& spring);
  void add_plane_wheel(const PlaneWheel& wheel);
  Formula energy_of(const Body& body, const Frame& frame) const;

  // joints.cpp
  struct Hold {  ///< what a joint's rows are written by; force and torque on the second body, in space
    Vec apart;   ///< from the point of the first body to that of the second, in space
    bool plane;
    Vec force = zero_vector(), torque = zero_vector();
  };
  void add_joint(const Joint& joint);
  void add_distance(const Joint& joint);
  void add_meeting_rows(const Joint& joint, Hold& hold);
  void add_locked_rows(const Joint& joint, Hold& hold);
  void add_slide_rows(const Joint& joint, Hold& hold);
  void add_turn_row(const Joint& joint, Hold& hold, const std::string& name, const Vec& a, const Vec& b);
  void add_hinge(const Joint& joint, Hold& hold);
  void add_slide_drive(const Joint& joint);
  std::array<Vec, 2> axes_of(const Joint& joint);
  std::vector<std::string> coordinates_of(int body) const;

  // contacts.cpp
  struct Touch {                                 ///< a contact as formulas
    Vec centre;                                  ///< of the ball or disc, the point of a knife edge
    Vec e1 = zero_vector(), e2 = zero_vector();  ///< of a disc, in space
    Vec blade = zero_vector();                   ///< of a knife edge, in space
  };
  Touch touch_of(const Contact& contact, const Pose& pose) const;
  void add_contact(const Contact& contact);
  void add_plane_knife(const Contact& contact);
  void add_contact_on_plane(const Contact& contact);
  void add_contact_on_surface(const Contact& contact);
  void place(const Contact& contact);
  /// From the centre of a disc to its lowest point.
  Vec arm_of(const Contact& contact, const Touch& touch, const Formula& tilt) const;

  const Body& body(int number) const { return mechanism_.bodies[static_cast<std::size_t>(number)]; }
  bool plane(int number) const { return number != ground && body(number).plane; }
  Frame& frame(int number) { return number == ground ? ground_ : frames_[static_cast<std::size_t>(number)]; }
  /// The two points, each in its own body.
  std::array<Vec, 2> ends(const std::string& name, int first, int second, const SharedVector& point,
                          const std::optional<std::array<Vec, 2>>& in_space, int source);
  /// The formula under a name of its own where it is long.
  Formula define(const std::string& name, const Formula& formula, int source);
  Vec define(const std::string& name, const Vec& vector, int source);
  void row(const std::string& name, const Formula& zero, int source);
  void output(const std::string& name, const Formula& formula, int source);
  void outputs(const std::string& name, const Vec& vector, bool plane, int source);
  void guess(const std::string& coordinate, bool velocity);
  void push(const std::string& coordinate, const Formula& force, int source);
  void torque(int body, const Vec& torque_in_body, int source);

  const Mechanism& mechanism_;
  Expansion made_;
  Frame ground_;
  std::vector<Frame> frames_;
  Formula lagrangian_ = 0.0, dissipation_ = 0.0;
  std::map<std::string, Formula> force_;
  std::set<std::string> guessed_;
};

/// lambda_ROW.
Formula multiplier(const std::string& row);

}  // namespace diracstep::bodies
