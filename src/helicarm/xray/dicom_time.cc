// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/dicom_time.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/xray/dicom_tags.h"

namespace helicarm::xray {
namespace {

/// `count` digits at `from`; nothing if one is not a digit.
std::optional<int> digits(std::string_view text, std::size_t from, std::size_t count) {
  int value = 0;
  for (std::size_t i = from; i < from + count; ++i) {
    if (i >= text.size() || text[i] < '0' || text[i] > '9') return std::nullopt;
    value = 10 * value + (text[i] - '0');
  }
  return value;
}

/// YYYYMMDD, in seconds since 1970.
std::optional<double> date_s(std::string_view text) {
  const auto year = digits(text, 0, 4), month = digits(text, 4, 2), day = digits(text, 6, 2);
  if (!year || !month || !day) return std::nullopt;
  using namespace std::chrono;
  const year_month_day date = std::chrono::year(*year) / *month / *day;
  if (!date.ok()) return std::nullopt;
  constexpr double day_s = 86400;
  return day_s * double(std::chrono::sys_days(date).time_since_epoch().count());
}

struct TimeOfDay {
  double seconds;
  double resolution_s;
  std::string_view rest;
};

/// HHMMSS[.F to .FFFFFF]. A fraction of zeros only is ignored.
std::optional<TimeOfDay> time_of_day(std::string_view text) {
  const auto hours = digits(text, 0, 2), minutes = digits(text, 2, 2), seconds = digits(text, 4, 2);
  constexpr int leap_second = 60;
  if (!hours || !minutes || !seconds || *hours > 23 || *minutes > 59 || *seconds > leap_second)
    return std::nullopt;
  TimeOfDay time{3600.0 * *hours + 60.0 * *minutes + *seconds, 1, text.substr(6)};
  if (!time.rest.starts_with('.')) return time;
  time.rest.remove_prefix(1);
  const std::size_t count =
      std::min<std::size_t>(time.rest.find_first_not_of("0123456789"), time.rest.size());
  if (count == 0 || count > 6) return std::nullopt;
  const double unit = std::pow(10.0, -double(count));
  if (const int fraction = *digits(time.rest, 0, count); fraction != 0) {
    time.seconds += fraction * unit;
    time.resolution_s = unit;
  }
  time.rest.remove_prefix(count);
  return time;
}

/// +HHMM or -HHMM.
std::optional<double> offset_s(std::string_view text) {
  const auto hours = digits(text, 1, 2), minutes = digits(text, 3, 2);
  if (text.size() != 5 || (text[0] != '+' && text[0] != '-') || !hours || !minutes) return std::nullopt;
  return (text[0] == '-' ? -60 : 60) * (60.0 * *hours + *minutes);
}

constexpr std::string_view of_content = "Content Date and Time", in_utc = ", UTC";

std::optional<AcquisitionTime> moment(std::string_view date, std::string_view time, std::string_view zone,
                                      std::string source) {
  const auto day = date_s(date);
  const auto clock = time_of_day(time);
  if (!day || !clock) return std::nullopt;
  const auto offset = offset_s(clock->rest.empty() ? zone : clock->rest);
  if (!clock->rest.empty() && !offset) return std::nullopt;
  if (offset) source += in_utc;
  return AcquisitionTime{*day + clock->seconds - offset.value_or(0), clock->resolution_s, std::move(source)};
}

}  // namespace

std::optional<AcquisitionTime> acquisition_time(const DicomElements& elements) {
  const std::string_view zone = elements.text(tags::timezone);
  const std::string_view both = elements.text(tags::acquisition_date_time);
  constexpr std::size_t date_size = 8;
  if (both.size() > date_size)
    if (auto read = moment(both.substr(0, date_size), both.substr(date_size), zone, "Acquisition DateTime"))
      return read;
  const auto of = [&](DicomTag date, DicomTag time, const char* source) {
    const std::string_view day = elements.text(date);
    return day.size() == date_size ? moment(day, elements.text(time), zone, source) : std::nullopt;
  };
  if (auto read = of(tags::acquisition_date, tags::acquisition_time, "Acquisition Date and Time"))
    return read;
  return of(tags::content_date, tags::content_time, of_content.data());
}

std::string dicom_date_time(double seconds_since_1970) {
  using namespace std::chrono;
  const sys_time<microseconds> moment(microseconds(std::llround(1e6 * seconds_since_1970)));
  const sys_days day = floor<days>(moment);
  const year_month_day date(day);
  const hh_mm_ss<microseconds> time(moment - day);
  return fmt::format("{:04}{:02}{:02}{:02}{:02}{:02}.{:06}+0000", int(date.year()), unsigned(date.month()),
                     unsigned(date.day()), time.hours().count(), time.minutes().count(),
                     time.seconds().count(), time.subseconds().count());
}

WrittenTime written_time(const AcquisitionTime& time) {
  constexpr std::size_t date_digits = 8, whole_digits = 14, most_decimals = 6;
  const double unit = time.resolution_s > 0 ? std::min(time.resolution_s, 1.0) : 1e-6;
  const auto decimals =
      std::min(std::size_t(std::lround(std::ceil(-std::log10(unit) - 1e-9))), most_decimals);
  const double rounding = std::pow(10.0, -double(decimals));
  const std::string all = dicom_date_time(std::round(time.seconds / rounding) * rounding);
  // A time without a source is this program's own.
  const bool utc = time.source.empty() || time.source.ends_with(in_utc);
  return {all.substr(0, date_digits),
          all.substr(date_digits, whole_digits - date_digits + (decimals > 0 ? 1 + decimals : 0)),
          utc ? "+0000" : "", time.source.starts_with(of_content)};
}

}  // namespace helicarm::xray
