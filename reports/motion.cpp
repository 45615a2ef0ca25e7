#include <algorithm>
#include <cctype>
#include <cmath>
#include <diracstep/reports/motion.hpp>
#include <diracstep/scene_format/position_names.hpp>
#include <initializer_list>
#include <map>
#include <string_view>

namespace diracstep {

namespace {

constexpr std::size_t max_bodies = 400, max_elements = 256, max_curves = 6;
constexpr std::size_t fewest_elements = 8;
constexpr int max_rows = 2000;  // of a block; more are not looked at
constexpr double same_direction = 1e-9;

/// The note of a coordinate, or of the family that it is an element of: x_7 of x.
SymbolNote note_of(const CatalogueScene& entry, const std::string& coordinate) {
  for (const SymbolNote& note : entry.notes)
    if (note.name == coordinate || coordinate.starts_with(note.name + "_")) return note;
  return {coordinate, "", ""};
}

DrawnMotion::Coordinate coordinate(const CatalogueScene& entry, int index) {
  const auto place = static_cast<std::size_t>(index);
  const Scene& scene = *entry.scene;
  const std::string name = scene.space ? position_names(scene)[place] : scene.coordinates[place];
  return {index, name, note_of(entry, name).unit};
}

std::string family(const std::string& name) { return name.substr(0, name.find_last_of('_')); }

void add_body(DrawnMotion& motion, const CatalogueScene& entry, const std::string& name, int x, int y) {
  const int place = static_cast<int>(motion.coordinates.size());
  motion.coordinates.push_back(coordinate(entry, x));
  motion.coordinates.push_back(coordinate(entry, y));
  motion.bodies.push_back({name, place, place + 1});
}

/// The points whose coordinates are named x… and y…, of one unit.
void find_bodies(DrawnMotion& motion, const CatalogueScene& entry) {
  const std::vector<std::string> names = position_names(*entry.scene);
  std::map<std::string_view, int> index;
  for (std::size_t i = 0; i < names.size(); ++i) index[names[i]] = static_cast<int>(i);
  for (std::size_t i = 0; i < names.size() && motion.bodies.size() < max_bodies; ++i) {
    if (!names[i].starts_with('x')) continue;
    const std::string number = names[i].substr(1);
    const auto y = index.find("y" + number);
    if (y == index.end() || note_of(entry, names[i]).unit != note_of(entry, "y" + number).unit) continue;
    add_body(motion, entry, number.starts_with('_') ? number.substr(1) : number, static_cast<int>(i),
             y->second);
  }
}

void find_heading(DrawnMotion& motion, const CatalogueScene& entry) {
  const std::vector<std::string> names = position_names(*entry.scene);
  for (std::size_t i = 0; i < names.size() && motion.bodies.size() == 1; ++i) {
    const SymbolNote note = note_of(entry, names[i]);
    if (note.unit != "rad" || note.meaning.find("heading") == std::string::npos) continue;
    motion.bodies[0].heading = static_cast<int>(motion.coordinates.size());
    motion.coordinates.push_back(coordinate(entry, static_cast<int>(i)));
    return;
  }
}

/// Finds the bars among the holonomic rows, from their derivatives at the start.
class Bars {
 public:
  Bars(DrawnMotion& motion, const Scene& scene)
      : motion_(motion), q_(scene.start.q), time_(scene.start.time) {
    for (std::size_t b = 0; b < motion.bodies.size(); ++b) {
      body_[motion.coordinates[static_cast<std::size_t>(motion.bodies[b].x)].index] = static_cast<int>(b);
      body_[motion.coordinates[static_cast<std::size_t>(motion.bodies[b].y)].index] = static_cast<int>(b);
    }
  }

  void look_at(const ConstraintRows& rows) {
    Vector a(rows.pattern().nonzeros()), b(rows.rows());
    rows.coefficients(time_, q_, a, b);
    std::vector<std::map<int, double>> gradients(static_cast<std::size_t>(rows.rows()));
    const auto entries = rows.pattern().entries();
    for (std::size_t k = 0; k < entries.size(); ++k)
      gradients[static_cast<std::size_t>(entries[k].first)][entries[k].second] =
          a[static_cast<Eigen::Index>(k)];
    for (int row = 0; row < rows.rows() && motion_.bars.size() < 2 * max_bodies; ++row)
      look_at(rows, row, gradients[static_cast<std::size_t>(row)]);
  }

 private:
  using Point = Eigen::Vector2d;

  void look_at(const ConstraintRows& rows, int row, const std::map<int, double>& gradient) {
    std::vector<int> bodies;
    for (const auto& [column, value] : gradient) {
      const auto found = body_.find(column);
      if (found == body_.end()) return;  // it holds something that is not drawn
      if (std::ranges::find(bodies, found->second) == bodies.end()) bodies.push_back(found->second);
    }
    if (bodies.size() == 1) pin(rows, row, bodies[0], gradient);
    if (bodies.size() == 2) bar(bodies[0], bodies[1], gradient);
  }

  /// φ depends on the distance of two points alone: ∂φ/∂P = −∂φ/∂Q along P − Q.
  void bar(int from, int to, const std::map<int, double>& gradient) {
    const Point p = part(from, gradient), q = part(to, gradient), along = place(from) - place(to);
    if ((p + q).norm() > same_direction * p.norm() || p.norm() == 0.0) return;
    if (std::abs(p.x() * along.y() - p.y() * along.x()) > same_direction * p.norm() * along.norm()) return;
    motion_.bars.push_back({from, to});
  }

  /// φ = c (P − C)² + const: the second derivative is 2c times the identity, and C = P − ∂φ/∂P / 2c.
  void pin(const ConstraintRows& rows, int row, int body, const std::map<int, double>& gradient) {
    const SparsityPattern& pattern = rows.curvature_pattern();
    Vector second(pattern.nonzeros());
    rows.annihilator_derivative(time_, q_, Vector::Unit(rows.rows(), row), second);
    const auto [x, y] = indices(body);
    const auto at = [&](int i, int j) {
      const int position = pattern.position(i, j);
      return position < 0 ? 0.0 : second[position];
    };
    const double c = at(x, x);
    if (c == 0.0 || std::abs(at(y, y) - c) > same_direction * std::abs(c) ||
        std::abs(at(x, y)) > same_direction * std::abs(c))
      return;
    const Point centre = place(body) - part(body, gradient) / c;
    motion_.bars.push_back({body, -1 - static_cast<int>(motion_.pins.size())});
    motion_.pins.push_back({centre.x(), centre.y()});
  }

  std::pair<int, int> indices(int body) const {
    const DrawnMotion::Body& b = motion_.bodies[static_cast<std::size_t>(body)];
    return {motion_.coordinates[static_cast<std::size_t>(b.x)].index,
            motion_.coordinates[static_cast<std::size_t>(b.y)].index};
  }
  Point place(int body) const {
    const auto [x, y] = indices(body);
    return {q_[x], q_[y]};
  }
  Point part(int body, const std::map<int, double>& gradient) const {
    const auto [x, y] = indices(body);
    const auto value = [&](int i) { return gradient.contains(i) ? gradient.at(i) : 0.0; };
    return {value(x), value(y)};
  }

  DrawnMotion& motion_;
  const Vector& q_;
  double time_;
  std::map<int, int> body_;  ///< of a coordinate
};

/// The elements of a scene whose coordinates are one long family, some left out where there are too many.
bool find_profile(DrawnMotion& motion, const CatalogueScene& entry) {
  const std::vector<std::string> names = position_names(*entry.scene);
  if (names.size() < fewest_elements) return false;
  for (const std::string& name : names)
    if (family(name) != family(names.front())) return false;
  const std::size_t every = (names.size() + max_elements - 1) / max_elements;
  for (std::size_t i = 0; i < names.size(); i += every)
    motion.coordinates.push_back(coordinate(entry, static_cast<int>(i)));
  motion.form = DrawnMotion::Form::profile;
  return true;
}

bool find_plane(DrawnMotion& motion, const CatalogueScene& entry) {
  find_bodies(motion, entry);
  if (motion.bodies.empty() && entry.scene->storage_size() == 2) add_body(motion, entry, "", 0, 1);
  if (motion.bodies.empty()) return false;
  motion.form = DrawnMotion::Form::plane;
  find_heading(motion, entry);
  Bars bars(motion, *entry.scene);
  for (const auto& rows : entry.scene->constraints)
    if (!entry.scene->space && rows->holonomic() && rows->rows() <= max_rows) bars.look_at(*rows);
  return true;
}

bool find_solids(DrawnMotion& motion, const CatalogueScene& entry) {
  for (const DrawnBody& body : entry.bodies) {
    if (motion.solids.size() == max_bodies) break;
    DrawnMotion::Solid& solid =
        motion.solids.emplace_back(DrawnMotion::Solid{body.name, body.shape, body.size, {}, body.fixed});
    for (const int index : body.coordinates) {
      solid.places.push_back(static_cast<int>(motion.coordinates.size()));
      motion.coordinates.push_back(coordinate(entry, index));
    }
  }
  if (motion.solids.empty()) return false;
  motion.form = DrawnMotion::Form::space;
  return true;
}

/// Whether a unit such as "N s/m" or "1/s^2" speaks of the symbol.
bool speaks_of(const std::string& unit, std::string_view symbol) {
  const auto letter = [](char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0; };
  for (std::size_t at = unit.find(symbol); at != std::string::npos; at = unit.find(symbol, at + 1)) {
    const std::size_t end = at + symbol.size();
    if ((at == 0 || !letter(unit[at - 1])) && (end == unit.size() || !letter(unit[end]))) return true;
  }
  return false;
}

}  // namespace

DrawnMotion motion_of(const CatalogueScene& entry) {
  DrawnMotion motion;
  if (find_solids(motion, entry) || find_plane(motion, entry) || find_profile(motion, entry)) return motion;
  const std::size_t count = std::min(static_cast<std::size_t>(entry.scene->storage_size()), max_curves);
  for (std::size_t i = 0; i < count; ++i)
    motion.coordinates.push_back(coordinate(entry, static_cast<int>(i)));
  return motion;
}

const char* name(DrawnMotion::Form form) {
  switch (form) {
    case DrawnMotion::Form::space:
      return "space";
    case DrawnMotion::Form::plane:
      return "plane";
    case DrawnMotion::Form::profile:
      return "profile";
    case DrawnMotion::Form::curves:
      return "curves";
  }
  return "unknown";
}

std::string time_unit(const std::vector<SymbolNote>& notes) {
  const auto any = [&](std::initializer_list<const char*> symbols) {
    return std::ranges::any_of(notes, [&](const SymbolNote& note) {
      return std::ranges::any_of(symbols, [&](const char* s) { return speaks_of(note.unit, s); });
    });
  };
  if (any({"d"})) return "d";
  if (any({"s", "N", "kg", "F", "H", "V", "A", "W", "J"})) return "s";
  const bool any_pure = std::ranges::find(notes, "1", &SymbolNote::unit) != notes.end();
  const bool all_pure = std::ranges::all_of(notes, [](const SymbolNote& note) {
    return note.unit.empty() || note.unit == "1" || note.unit == "rad";
  });
  return any_pure && all_pure ? "1" : "";
}

}  // namespace diracstep
