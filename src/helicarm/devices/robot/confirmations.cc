// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/confirmations.h"

#include <random>

#include <fmt/format.h>

namespace helicarm::robot {

std::string Confirmations::confirm(const RobotOrder& order, Clock::time_point now) {
  thread_local std::random_device random;
  const std::string token = fmt::format("{:08x}{:08x}{:08x}{:08x}", random(), random(), random(), random());
  entries_[token] = {to_json(order).dump(), now + valid_for_};
  return token;
}

Expected<void> Confirmations::redeem(const std::string& token, const RobotOrder& order,
                                     Clock::time_point now) {
  const auto found = entries_.find(token);
  if (found == entries_.end())
    return fail(Reason::order_not_confirmed,
                "this token is unknown or was used before: confirm the order again");
  const Entry entry = std::move(found->second);
  entries_.erase(found);
  if (now > entry.until)
    return fail(Reason::order_not_confirmed, "the token has expired: confirm the order again");
  if (entry.order != to_json(order).dump())
    return fail(Reason::order_not_confirmed, "the token was given for another order");
  return {};
}

void Confirmations::forget_all() { entries_.clear(); }

}  // namespace helicarm::robot
