// SPDX-License-Identifier: Apache-2.0
#include "helicarm/measures/kinds.h"

#include <algorithm>
#include <array>

namespace helicarm::measures {
namespace {

using Words = std::string_view;

constexpr std::array distance_roles{Role{"from", "the first point"}, Role{"to", "the second point"}};
constexpr std::array angle_roles{Role{"first", "a point on the first leg"}, Role{"vertex", "the vertex"},
                                 Role{"second", "a point on the second leg"}};
constexpr std::array line_angle_roles{
    Role{"line1_from", "the first line's first point"}, Role{"line1_to", "the first line's second point"},
    Role{"line2_from", "the second line's first point"}, Role{"line2_to", "the second line's second point"}};
constexpr std::array circle_roles{Role{"rim1", "the rim"}, Role{"rim2", "the rim, a second point"},
                                  Role{"rim3", "the rim, a third point"}};
constexpr std::array quadrant_roles{Role{"blumensaat_posterior", "Blumensaat's line, its posterior end"},
                                    Role{"blumensaat_anterior", "Blumensaat's line, its anterior end"},
                                    Role{"inferior", "the lateral condyle's inferior border"},
                                    Role{"posterior", "the lateral condyle's posterior border", true},
                                    Role{"anterior", "the lateral condyle's anterior border", true}};
constexpr std::array tibia_ap_roles{Role{"anterior", "the tibial plateau's anterior margin"},
                                    Role{"posterior", "the tibial plateau's posterior margin"},
                                    Role{"plateau1", "the medial plateau's line, its first point", true},
                                    Role{"plateau2", "the medial plateau's line, its second point", true}};
constexpr std::array tibia_ml_roles{Role{"medial", "the tibial plateau's medial margin"},
                                    Role{"lateral", "the tibial plateau's lateral margin"}};
constexpr std::array<Words, 2> depth_height{"depth", "height"}, condyle{"condyle_depth", "condyle_height"};
constexpr std::array<Words, 1> from_anterior{"from_anterior"}, from_medial{"from_medial"},
    sagittal_diameter{"sagittal_diameter"}, width{"width"};

constexpr std::array table{
    KindInfo{Kind::distance, "distance", "Distance", "Distance", distance_roles},
    KindInfo{Kind::angle, "angle", "Angle", "Angle", angle_roles},
    KindInfo{Kind::line_angle, "line_angle", "Angle between two lines", "Line angle", line_angle_roles},
    KindInfo{Kind::circle, "circle", "Circle", "Circle", circle_roles, Further::rim},
    KindInfo{Kind::femoral_quadrants, "femoral_quadrants", "Femoral quadrants (Bernard and Hertel)", "Femur",
             quadrant_roles, Further::points, depth_height, condyle},
    KindInfo{Kind::tibia_ap, "tibia_ap", "Tibia, anterior to posterior", "Tibia AP", tibia_ap_roles,
             Further::points, from_anterior, sagittal_diameter},
    KindInfo{Kind::tibia_ml, "tibia_ml", "Tibia, medial to lateral", "Tibia ML", tibia_ml_roles,
             Further::points, from_medial, width}};

}  // namespace

std::span<const KindInfo> kinds() { return table; }

const KindInfo& info_of(Kind kind) { return table[static_cast<std::size_t>(kind)]; }

std::optional<Kind> kind_named(std::string_view word) {
  const auto found = std::ranges::find(table, word, &KindInfo::word);
  return found == table.end() ? std::nullopt : std::optional(found->kind);
}

}  // namespace helicarm::measures
