// SPDX-License-Identifier: Apache-2.0
#include "helicarm/virtual_devices/robot/urscript.h"

#include <cctype>
#include <charconv>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/core/text.h"

namespace helicarm::robot {
namespace {

constexpr std::size_t longest_script = 65536;
constexpr int longest_expression = 200;  ///< operands and operators; also bounds nesting

bool starts_word(char c) { return std::isalpha(static_cast<unsigned char>(c)) || c == '_'; }
bool continues_word(char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_'; }

/// Removes and returns the first word.
std::string take_word(std::string_view& text) {
  std::size_t size = 0;
  if (!text.empty() && starts_word(text[0]))
    while (size < text.size() && continues_word(text[size])) ++size;
  const std::string word(text.substr(0, size));
  text = trimmed(text.substr(size));
  return word;
}

/// A call in the script.
struct Call {
  std::string name;
  std::vector<UrValue> arguments;
  std::map<std::string, double> named;
};

/// Recursive descent over one expression: or, and, not, comparison, sum, product, sign, primary.
class Expression {
 public:
  Expression(std::string_view text, const std::map<std::string, UrValue>& variables, UrScriptHost& host)
      : rest_(trimmed(text)), variables_(variables), host_(host) {}

  UrValue whole() {
    UrValue value = either();
    if (!rest_.empty()) refuse();
    return value;
  }
  Call whole_call() {
    Call call = arguments_of(take_word(rest_));
    if (!rest_.empty()) refuse();
    return call;
  }

 private:
  [[noreturn]] void refuse() const {
    throw BadInput(
        Reason::bad_value,
        "syntax error before \"" + without_control_characters(std::string(rest_.substr(0, 30))) + "\"");
  }
  bool taken(std::string_view mark) {
    if (!rest_.starts_with(mark)) return false;
    rest_ = trimmed(rest_.substr(mark.size()));
    return true;
  }
  void expect(std::string_view mark) {
    if (!taken(mark)) refuse();
  }
  static double number(const UrValue& value) {
    if (value.size() != 1) throw BadInput(Reason::bad_value, "expected a number, not a list");
    return value[0];
  }
  bool taken_word(std::string_view word) {
    std::string_view ahead = rest_;
    if (take_word(ahead) != word) return false;
    rest_ = ahead;
    return true;
  }
  UrValue either() {
    UrValue value = both();
    while (taken_word("or")) value = {both() != UrValue{0} || value != UrValue{0} ? 1.0 : 0.0};
    return value;
  }
  UrValue both() {
    UrValue value = negation();
    while (taken_word("and")) value = {negation() != UrValue{0} && value != UrValue{0} ? 1.0 : 0.0};
    return value;
  }
  UrValue negation() {
    if (!taken_word("not")) return comparison();
    if (++parts_ > longest_expression) throw BadInput(Reason::bad_value, "expression is too long");
    return {negation() == UrValue{0} ? 1.0 : 0.0};
  }
  static double finite(double value) {
    if (!std::isfinite(value)) throw BadInput(Reason::not_finite, "a number is not finite");
    return value;
  }
  UrValue comparison() {
    const UrValue left = sum();
    for (const std::string_view mark : {"==", "!=", "<=", ">=", "<", ">"}) {
      if (!taken(mark)) continue;
      const double a = number(left), b = number(sum());
      const bool holds = mark == "=="   ? a == b
                         : mark == "!=" ? a != b
                         : mark == "<=" ? a <= b
                         : mark == ">=" ? a >= b
                         : mark == "<"  ? a < b
                                        : a > b;
      return {holds ? 1.0 : 0.0};
    }
    return left;
  }
  UrValue sum() {
    UrValue value = product();
    for (;;) {
      if (taken("+"))
        value = {finite(number(value) + number(product()))};
      else if (taken("-"))
        value = {finite(number(value) - number(product()))};
      else
        return value;
    }
  }
  UrValue product() {
    UrValue value = primary();
    while (taken("*")) value = {finite(number(value) * number(primary()))};
    return value;
  }
  UrValue primary() {
    if (++parts_ > longest_expression) throw BadInput(Reason::bad_value, "expression is too long");
    if (taken("-")) return {-number(primary())};
    if (taken("(")) {
      UrValue value = either();
      expect(")");
      return value;
    }
    if (taken("p[") || taken("[")) return list("]");
    if (rest_.empty()) refuse();
    if (!starts_word(rest_[0])) return {literal()};
    const std::string word = take_word(rest_);
    if (word == "True") return {1};
    if (word == "False") return {0};
    if (rest_.starts_with("(")) {
      const Call call = arguments_of(word);
      return host_.call(call.name, call.arguments);
    }
    const auto found = variables_.find(word);
    if (found == variables_.end()) throw BadInput(Reason::bad_value, "variable " + word + " is not defined");
    return found->second;
  }
  double literal() {
    double value = 0;
    const auto [end, error] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), value);
    if (error != std::errc() || !std::isfinite(value)) refuse();
    rest_ = trimmed(rest_.substr(static_cast<std::size_t>(end - rest_.data())));
    return value;
  }
  UrValue list(std::string_view close) {
    UrValue values;
    if (taken(close)) return values;
    do values.push_back(number(either()));
    while (taken(","));
    expect(close);
    return values;
  }
  Call arguments_of(const std::string& name) {
    Call call{name, {}, {}};
    expect("(");
    if (taken(")")) return call;
    do {
      std::string_view ahead = rest_;
      const std::string word = take_word(ahead);
      if (!word.empty() && ahead.starts_with("=") && !ahead.starts_with("==")) {
        rest_ = trimmed(ahead.substr(1));
        call.named[word] = number(either());
      } else {
        call.arguments.push_back(either());
      }
    } while (taken(","));
    expect(")");
    return call;
  }

  std::string_view rest_;
  const std::map<std::string, UrValue>& variables_;
  UrScriptHost& host_;
  int parts_ = 0;
};

bool is_motion(std::string_view name) { return name == "movel" || name == "movej" || name == "stopj"; }

/// "while EXPRESSION:" and similar: the text between word and colon.
std::string head_of(std::string_view line, std::string_view word) {
  line = trimmed(line.substr(word.size()));
  if (line.empty() || line.back() != ':') throw BadInput(Reason::bad_value, "a colon is missing");
  return std::string(trimmed(line.substr(0, line.size() - 1)));
}

/// "name()" of def, thread and run.
std::string name_of(std::string_view text) {
  const std::string name = take_word(text);
  if (name.empty() || text != "()") throw BadInput(Reason::bad_value, "expected a name with ()");
  return name;
}

}  // namespace

/// Translates a script line by line.
class UrScript::Reader {
 public:
  int line() const { return line_; }

  UrScript read(std::string_view text) {
    while (!text.empty()) {
      const std::size_t size = std::min(text.find('\n'), text.size());
      const std::string_view line = trimmed(text.substr(0, size));
      text.remove_prefix(std::min(size + 1, text.size()));
      ++line_;
      if (!line.empty()) read_line(line);
    }
    if (!ended_) throw BadInput(Reason::truncated, "the program's end is missing");
    script_.threads_.push_back(std::make_unique<Thread>());
    return std::move(script_);
  }

 private:
  struct Block {
    std::string word, code;
    std::size_t start;
  };

  Code& code() { return script_.codes_[open_.back().code]; }
  void add(Kind kind, std::string name, std::string expression) {
    code().push_back({kind, std::move(name), std::move(expression), 0, line_});
  }

  void read_line(std::string_view line) {
    if (ended_) throw BadInput(Reason::bad_value, "text after the program's end");
    std::string_view after = line;
    const std::string word = take_word(after);
    if (open_.empty()) {
      if (word != "def") throw BadInput(Reason::bad_value, "a program starts with def");
      name_of(head_of(line, word));
      open_.push_back({word, "", 0});
      script_.codes_[""];
    } else if (word == "end" && after.empty()) {
      close();
    } else if (word == "thread") {
      if (open_.size() != 1) throw BadInput(Reason::unsupported, "a thread inside a block is not supported");
      const std::string name = name_of(head_of(line, word));
      open_.push_back({word, name, 0});
      script_.codes_[name];
    } else if (word == "while" || word == "if") {
      add(Kind::branch_unless, {}, head_of(line, word));
      open_.push_back({word, open_.back().code, code().size() - 1});
    } else if (word == "else") {
      otherwise(after);
    } else if (word == "halt" && after.empty()) {
      add(Kind::halt, {}, {});
    } else if (word == "kill") {
      add(Kind::kill, take_word(after), {});
    } else {
      statement(line, word == "global" ? after : line, word == "global");
    }
  }

  void close() {
    const Block block = open_.back();
    Code& commands = code();
    if (block.word == "while") {
      commands.push_back({Kind::jump, {}, {}, block.start, line_});
      commands[block.start].target = commands.size();
    } else if (block.word == "if" || block.word == "else") {
      commands[block.start].target = commands.size();
    }
    open_.pop_back();
    ended_ = open_.empty();
  }

  void otherwise(std::string_view after) {
    if (open_.back().word != "if" || after != ":") throw BadInput(Reason::bad_value, "else without if");
    add(Kind::jump, {}, {});
    code()[open_.back().start].target = code().size();
    open_.back() = {"else", open_.back().code, code().size() - 1};
  }

  void statement(std::string_view line, std::string_view value, bool global) {
    const std::string name = take_word(value);
    if (value.starts_with("=") && !value.starts_with("==")) {
      value = trimmed(value.substr(1));
      std::string_view running = value;
      if (take_word(running) == "run" && !running.starts_with("("))
        add(Kind::run, name, name_of(running));
      else
        add(Kind::assign, name, std::string(value));
    } else if (!global && value.starts_with("(")) {
      add(Kind::call, name, std::string(line));
    } else {
      throw BadInput(Reason::unsupported, "unknown statement");
    }
  }

  UrScript script_;
  std::vector<Block> open_;
  bool ended_ = false;
  int line_ = 0;
};

Expected<UrScript> UrScript::parse(std::string_view text) {
  if (text.size() > longest_script) return fail(Reason::bad_size, "script is too long");
  Reader reader;
  auto parsed = guarded([&] { return reader.read(text); });
  if (parsed) return parsed;
  return fail(parsed.error().reason,
              fmt::format("script: line {}: {}", reader.line(), parsed.error().message));
}

void UrScript::kill(const std::string& handle) {
  for (const auto& thread : threads_)
    if (thread->handle == handle) thread->ended = true;
}

bool UrScript::run(Thread& thread, UrScriptHost& host) {
  if (thread.in_motion && host.moving()) return true;
  thread.in_motion = false;
  const Code& code = codes_.at(thread.code);
  for (int commands = 0; thread.at < code.size(); ++commands) {
    const Command& command = code[thread.at++];
    try {
      if (commands == 1000) throw BadInput(Reason::bad_value, "1000 commands without a pause");
      Expression expression(command.expression, variables_, host);
      switch (command.kind) {
        case Kind::assign:
          variables_[command.name] = expression.whole();
          break;
        case Kind::run:
          if (!codes_.contains(command.expression)) throw BadInput(Reason::bad_value, "no such thread");
          if (threads_.size() >= 10) throw BadInput(Reason::bad_value, "too many threads");
          threads_.push_back(std::make_unique<Thread>(Thread{command.expression, command.name}));
          break;
        case Kind::kill:
          kill(command.name);
          break;
        case Kind::halt:
          return false;
        case Kind::branch_unless:
          if (expression.whole() == UrValue{0}) thread.at = command.target;
          break;
        case Kind::jump:
          thread.at = command.target;
          break;
        case Kind::call: {
          const Call call = expression.whole_call();
          if (call.name == "sync") return true;
          if (is_motion(call.name)) {
            host.start_motion(call.name, call.arguments, call.named);
            thread.in_motion = true;
            return true;
          }
          host.call(call.name, call.arguments);
        }
      }
    } catch (const BadInput& bad) {
      throw BadInput(bad.failure().reason,
                     fmt::format("script: line {}: {}", command.line, bad.failure().message));
    }
  }
  thread.ended = true;
  return !thread.code.empty();
}

Expected<bool> UrScript::step(UrScriptHost& host) {
  return guarded([&] {
    for (std::size_t i = 0; i < threads_.size(); ++i)
      if (!threads_[i]->ended && !run(*threads_[i], host)) return false;
    std::erase_if(threads_, [](const auto& thread) { return thread->ended; });
    return !threads_.empty();
  });
}

}  // namespace helicarm::robot
