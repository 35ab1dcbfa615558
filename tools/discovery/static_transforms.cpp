// SPDX-License-Identifier: Apache-2.0
#include "discovery/static_transforms.hpp"

#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

#include "bags/bag.hpp"
#include "drivers/files/motion_rows.hpp"

namespace locus::tools {
namespace {

/// Strips the leading slash of tf frame names, which tf2 dropped.
std::string bare(std::string_view frame) { return std::string{frame.substr(frame.starts_with('/') ? 1 : 0)}; }

/// Multiplies; exact where one factor is the identity.
Pose product(const Pose& T_a_b, const Pose& T_b_c) {
  if (T_a_b == Pose{})
    return T_b_c;
  return T_b_c == Pose{} ? T_a_b : T_a_b * T_b_c;
}

} // namespace

void StaticTransforms::add(MessageReader reader) {
  constexpr std::size_t kMost = 1000;
  for (auto left = reader.number<std::uint32_t>(); left > 0 && reader.whole() && parents_.size() < kMost; --left) {
    if (reader.serialisation() == Serialisation::ros1)
      reader.number<std::uint32_t>(); // sequence number
    reader.number<std::int32_t>();
    reader.number<std::uint32_t>();
    const std::string parent = bare(reader.text()), child = bare(reader.text());
    std::array<double, 7> v{};
    reader.numbers(v);
    const Eigen::Quaterniond q{v[6], v[3], v[4], v[5]};
    const Pose T_parent_child{unit_quaternion(q.w(), q.x(), q.y(), q.z()).value_or(q.normalized()), {v[0], v[1], v[2]}};
    const bool has_names = parent.size() <= kMaxNameBytes && child.size() <= kMaxNameBytes;
    if (reader.whole() && has_names && q.norm() > 0.5 && T_parent_child.finite())
      parents_.insert_or_assign(child, Parent{parent, T_parent_child});
  }
}

std::optional<Pose> StaticTransforms::between(std::string_view to, std::string_view from) const {
  const std::string target = bare(to), source = bare(from);
  std::map<std::string_view, Pose> T_ancestor_to; // stops where a cycle repeats
  const auto list = [&](std::string_view frame, const Pose& T) { return T_ancestor_to.try_emplace(frame, T).second; };
  climb(target, list);
  std::optional<Pose> found;
  std::size_t steps = 0;
  climb(source, [&](std::string_view frame, const Pose& T_frame_from) {
    if (const auto common = T_ancestor_to.find(frame); common != T_ancestor_to.end())
      found = product(common->second.inverse(), T_frame_from);
    return !found && ++steps <= parents_.size(); // a cycle would never end
  });
  return found;
}

/// Visits the frame and its ancestors, itself first, while `visit` returns true.
template <class Visit> void StaticTransforms::climb(std::string_view frame, Visit visit) const {
  Pose T_ancestor_frame;
  auto parent = parents_.find(frame);
  while (visit(frame, T_ancestor_frame) && parent != parents_.end()) {
    frame = parent->second.frame;
    T_ancestor_frame = product(parent->second.T_parent_child, T_ancestor_frame);
    parent = parents_.find(frame);
  }
}

} // namespace locus::tools
