// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/core/json.h"
#include "helicarm/devices/tracker/hand_eye.h"
#include "helicarm/operation/orders.h"

/// Values as the session log stores them: exact to the last bit.
namespace helicarm::operation {

Json to_json(const tracker::HandEye& hand_eye);
Json to_json(const std::vector<tracker::HandEyePair>& pairs);
/// Fails as JsonReader.
Expected<std::vector<tracker::HandEyePair>> hand_eye_pairs_from(const Json& json, const std::string& origin);
Json to_json(const std::vector<robot::Miss>& loop);
Json to_json(const EndMiss& end);
/// Of an outcome, the two ends.
Json to_json(const TunnelOutcome& outcome);
/// Of the robot before an order.
Json joints_json(const robot::Joints& joints);

}  // namespace helicarm::operation
