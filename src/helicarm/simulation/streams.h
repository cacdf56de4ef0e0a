// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

/// Purpose of each random stream of a simulated case.
namespace helicarm::simulation::stream {

inline constexpr std::uint32_t c_arm = 1000;
inline constexpr std::uint32_t patient = 1001;
inline constexpr std::uint32_t faults = 1002;
inline constexpr std::uint32_t tracker = 1003;
inline constexpr std::uint32_t clicks = 1004;
inline constexpr std::uint32_t uids = 1005;
inline constexpr std::uint32_t grid = 1006;
inline constexpr std::uint32_t readings = 1100;  ///< and following: two per tracked body
inline constexpr std::uint32_t arm = 1007;
inline constexpr std::uint32_t true_views = 1008;
inline constexpr std::uint32_t jitter = 1009;
inline constexpr std::uint32_t noise = 1010;  ///< and following: two per view

}  // namespace helicarm::simulation::stream
