// SPDX-License-Identifier: Apache-2.0
#include "studies/engine.h"

#include <algorithm>
#include <chrono>
#include <mutex>
#include <numeric>
#include <optional>
#include <thread>

#include "helicarm/core/parallel.h"
#include "studies/journal.h"

namespace helicarm::study {
namespace {

constexpr std::size_t blocks_per_turn = 4;  // per thread, between two exchanges of the ranks

class Run {
 public:
  Run(const std::vector<StudySetting>& settings, const std::string& identity, const EngineOptions& options,
      const Ranks& ranks)
      : settings_(settings), options_(options), ranks_(ranks), threads_(options.threads) {
    if (threads_ == 0)
      threads_ = std::max(1u, std::thread::hardware_concurrency() / unsigned(ranks.on_this_machine()));
    for (const StudySetting& setting : settings) total_cost_ += setting.cost;
    if (!options.journal.empty() && ranks.leads()) journal_.emplace(options.journal, identity);
  }

  std::vector<std::vector<double>> answers() {
    JournalContent before = content_before();
    std::vector<std::vector<double>>& settled = before.settled;
    while (settled.size() < settings_.size()) {
      const StudySetting& setting = settings_[settled.size()];
      values_.assign(ranks_.leads() ? setting.blocks * setting.values_per_block : 0, 0);
      done_.assign(setting.blocks, false);
      settled_ = settled;
      for (const auto& block : std::exchange(before.blocks, {}))
        keep(setting, block.number, block.values, false);
      share_done();
      run(setting);
      settled.push_back(setting.settle && ranks_.leads() ? setting.settle(values_) : values_);
      past_cost_ += setting.cost;
      if (journal_ && journal_begun_) value_or_throw(journal_->write({settled, {}}));
    }
    return ranks_.leads() ? settled : std::vector<std::vector<double>>{};
  }

 private:
  using Clock = std::chrono::steady_clock;

  /// Continues from the journal if the study is resumed. The other ranks receive the number of finished
  /// settings.
  JournalContent content_before() {
    JournalContent content;
    double trouble = 0;
    Failure failure;
    if (journal_ && options_.resume) {
      if (auto read = journal_->read())
        content = *std::move(read);
      else
        trouble = 1, failure = read.error();
    }
    const auto told = ranks_.from_leader({double(content.settled.size()), trouble});
    if (told[1] > 0)
      throw BadInput(ranks_.leads() ? failure : Failure{Reason::bad_value, "the journal was refused"});
    content.settled.resize(std::size_t(told[0]));
    for (std::size_t i = 0; i < std::min(settings_.size(), content.settled.size()); ++i)
      past_cost_ += settings_[i].cost;
    return content;
  }

  /// Sends the finished blocks' numbers to all ranks.
  void share_done() {
    const auto told = ranks_.from_leader(std::vector<double>(done_.begin(), done_.end()));
    for (std::size_t i = 0; i < told.size(); ++i) done_[i] = told[i] != 0;
  }

  void run(const StudySetting& setting) {
    std::vector<std::size_t> open;
    for (std::size_t block = 0; block < setting.blocks; ++block)
      if (!done_[block]) open.push_back(block);
    const auto crew = std::size_t(ranks_.count());
    // The number of the leader's threads: all ranks must exchange equally often, also if their machines have
    // different numbers of threads.
    const auto threads = std::size_t(ranks_.from_leader({double(threads_)}).front());
    const std::size_t turn =
        crew == 1 ? std::max<std::size_t>(open.size(), 1) : crew * threads * blocks_per_turn;
    for (std::size_t begin = 0; begin < open.size(); begin += turn) {
      std::vector<std::size_t> own;
      for (std::size_t i = begin + std::size_t(ranks_.own()); i < std::min(begin + turn, open.size());
           i += crew)
        own.push_back(open[i]);
      if (crew == 1)
        parallel_for(own.size(), threads_, [&](std::size_t i) {
          std::vector<double> values(setting.values_per_block);
          setting.work(own[i], values);
          keep(setting, own[i], values, true);
        });
      else
        run_turn(setting, own);
    }
  }

  /// With several ranks: each sends its blocks, with their numbers, to the leader.
  void run_turn(const StudySetting& setting, const std::vector<std::size_t>& own) {
    const std::size_t size = 1 + setting.values_per_block;
    std::vector<double> parcel(own.size() * size);
    parallel_for(own.size(), threads_, [&](std::size_t i) {
      parcel[i * size] = double(own[i]);
      setting.work(own[i], std::span(parcel).subspan(i * size + 1, setting.values_per_block));
    });
    const auto all = ranks_.gather(parcel);
    for (std::size_t i = 0; i < all.size(); i += size)
      keep(setting, std::size_t(all[i]), std::span(all).subspan(i + 1, setting.values_per_block), true);
  }

  void keep(const StudySetting& setting, std::size_t block, std::span<const double> values, bool fresh) {
    const std::lock_guard lock(guard_);
    if (block >= setting.blocks || values.size() != setting.values_per_block || done_[block]) return;
    std::ranges::copy(values, values_.begin() + std::ptrdiff_t(block * setting.values_per_block));
    done_[block] = true;
    if (fresh && journal_) write_down(setting, block, values);
    const auto count = double(std::ranges::count(done_, true));
    options_.progress((past_cost_ + setting.cost * count / double(setting.blocks)) / total_cost_);
  }

  void write_down(const StudySetting& setting, std::size_t block, std::span<const double> values) {
    if (journal_begun_) return value_or_throw(journal_->append(block, values));
    if (std::chrono::duration<double>(Clock::now() - start_).count() < options_.journal_after_s) return;
    JournalContent content{settled_, {}};
    for (std::size_t i = 0; i < setting.blocks; ++i)
      if (done_[i]) {
        const auto from = values_.begin() + std::ptrdiff_t(i * setting.values_per_block);
        content.blocks.push_back({i, {from, from + std::ptrdiff_t(setting.values_per_block)}});
      }
    value_or_throw(journal_->write(content));
    journal_begun_ = true;
  }

  const std::vector<StudySetting>& settings_;
  const EngineOptions& options_;
  const Ranks& ranks_;
  unsigned threads_;
  double total_cost_ = 0;
  double past_cost_ = 0;
  Clock::time_point start_ = Clock::now();

  std::mutex guard_;
  std::optional<Journal> journal_;
  bool journal_begun_ = false;
  std::vector<std::vector<double>> settled_;
  std::vector<double> values_;  ///< of the current setting, by block
  std::vector<bool> done_;      ///< finished blocks of the current setting
};

}  // namespace

Expected<std::vector<std::vector<double>>> run_study(const std::vector<StudySetting>& settings,
                                                     const std::string& identity,
                                                     const EngineOptions& options, const Ranks& ranks) {
  return guarded([&] { return Run(settings, identity, options, ranks).answers(); });
}

}  // namespace helicarm::study
