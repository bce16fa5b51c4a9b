// SPDX-License-Identifier: Apache-2.0
// Script commands as changes of the viewer's state.
#include "viewer/script/script.h"

#include <algorithm>
#include <array>
#include <sstream>
#include <string_view>
#include <utility>

#include "core/file/file.h"
#include "core/system/error.h"
#include "viewer/script/verb.h"
#include "viewer/view/actions.h"

namespace tg {
namespace {

constexpr std::uint64_t kMaxScriptBytes = 1 << 20;
constexpr int kFramesAfterResize = 4;  // the window system answers a size request some events later
constexpr int kFramesOfOpening = 4;    // announced, opened, shown
constexpr double kLongestAwait = 60;   // [s]
constexpr int kMostFrames = 100000;    // of a wait
constexpr int kMostRounds = 1000000;
constexpr int kMostModels = 1000000;  // of an await

int parseKey(const std::string& text, const std::string& what) {
  constexpr std::pair<std::string_view, int> kNames[] = {
      {"Space", ' '},     {"Esc", kKeyEscape},    {"PageUp", kKeyPageUp}, {"PageDown", kKeyPageDown},
      {"Home", kKeyHome}, {"Delete", kKeyDelete}, {"Num1", kKeyPad1},     {"Num3", kKeyPad3},
      {"Num7", kKeyPad7}, {"F11", kKeyF11},
  };
  for (const auto& [name, key] : kNames) {
    if (text == name) return key;
  }
  if (text.size() == 2 && text[0] == 'F' && text[1] >= '1' && text[1] <= '9') return kKeyF1 + text[1] - '1';
  if (text.size() == 1 && text[0] > ' ' && text[0] <= ']') return text[0];
  refuseValue(
      what, text,
      "a capital letter, a digit, a sign, Space, Esc, PageUp, PageDown, Home, Delete, F1 to F9, F11, Num1, Num3 or "
      "Num7, after Ctrl+, Shift+ or Ctrl+Shift+ if wanted");
}

int parseDocument(const Call& call) {
  const double number = call.number(0);
  const std::size_t count = call.state.documents.open.size();
  if (!(number >= 0 && number < static_cast<double>(count)) || number != static_cast<int>(number)) {
    refuseValue(call.what, call[0], "one of " + std::to_string(count) + " open models, counted from 0");
  }
  return static_cast<int>(number);
}

// Whether what `await` or `await-file` waits for is there. Throws Error(badData) when it takes too long.
bool arrived(Script& script, const ViewerState& state, const ScriptCommand& command, const std::string& what) {
  const std::string& word = command.words[0];
  const bool file = command.verb == "await-file";
  if (file ? std::filesystem::exists(word) : state.follow.reloads >= parseCount(word, 0, kMostModels, what)) {
    script.waiting_since = 0;
    return true;
  }
  if (script.waiting_since == 0) script.waiting_since = std::max(state.time, 1e-9);
  if (state.time - script.waiting_since <= kLongestAwait) return false;
  if (file) throw Error(ErrorKind::badData, what + ": no file \"" + word + "\" came in 60 s");
  throw Error(ErrorKind::badData, what + ": no such model came in 60 s (expected --follow and " + word +
                                      " models, found " + std::to_string(state.follow.reloads) + ")");
}

constexpr std::array kVerbs = {
    Verb{"key", 1, kFramesOfPanels,
         [](const Call& c) {
           const bool control = c[0].starts_with("Ctrl+");
           const std::string rest = control ? c[0].substr(5) : c[0];
           const bool shift = rest.starts_with("Shift+");
           const std::string name = shift ? rest.substr(6) : rest;
           const bool question = name == "?";  // which the help calls what Shift makes of /
           const int key = parseKey(question ? "/" : name, c.what);
           if (pressKey(c.state, control ? key | kControl : key, shift || question)) return;
           if (!control && std::string_view("WASDQEZX").find(name) != std::string_view::npos) {
             refuseValue(c.what, c[0],
                         "a key that acts at once; this one moves the camera while it is held, a script does by orbit, "
                         "dolly and camera");
           }
           refuseValue(c.what, c[0], "one of the keys that do something, F1 lists them");
         }},
    Verb{"tab", 1, kFramesOfPanels, [](const Call& c) { c.state.ui.tab = c.named<Tab>(); }},
    Verb{"panel", 1, kFramesOfPanels, [](const Call& c) { c.state.ui.panel = c.on(); }},
    Verb{"help", 1, kFramesOfPanels, [](const Call& c) { c.state.ui.help = c.on(); }},
    Verb{"open", 1, kFramesOfOpening, [](const Call& c) { c.state.documents.open_requests.emplace_back(c[0]); }},
    Verb{"begin-open", 1, 1,
         [](const Call& c) {
           c.state.documents.open_requests.emplace_back(c[0]);
           c.state.loading.script_goes_on = true;
         }},
    Verb{"await-open", 0, 1, [](const Call& c) { c.state.loading.script_goes_on = false; }},
    Verb{"document", 1, kFramesOfPanels, [](const Call& c) { c.state.documents.show_request = parseDocument(c); }},
    Verb{"close-document", 1, kFramesOfPanels,
         [](const Call& c) { c.state.documents.close_request = parseDocument(c); }},
    Verb{"compare", 1, kFramesOfPanels, [](const Call& c) { c.state.compare.how.mode = c.named<CompareMode>(); }},
    Verb{"compare-with", 1, 0,
         [](const Call& c) {
           c.state.compare.with_photographs = c[0] == "photographs";
           if (!c.state.compare.with_photographs) c.state.compare.other = c.state.documents.open[parseDocument(c)].path;
         }},
    Verb{"divider", 1, 0, [](const Call& c) { c.state.compare.how.divider = static_cast<float>(c.number(0, 0, 1)); }},
    Verb{"difference", 2, 0,
         [](const Call& c) {
           if (c[0] != "signed" && c[0] != "absolute") refuseValue(c.what, c[0], "signed or absolute");
           c.state.compare.how.with_sign = c[0] == "signed";
           c.state.compare.how.gain = static_cast<float>(c.number(1, 1e-3, kMaxGain));
         }},
    Verb{"keep-going", 1, 0, nullptr},
    Verb{"wait", 1, 0, nullptr},
    Verb{"repeat", 1, 1, nullptr},
    Verb{"await", 1, kFramesOfPanels, nullptr},
    Verb{"await-file", 1, kFramesOfPanels, nullptr},
    Verb{"size", 1, kFramesAfterResize, nullptr},
    Verb{"picture", 1, 1, [](const Call& c) { c.state.capture.picture = c[0]; }},
    Verb{"window", 1, 1, [](const Call& c) { c.state.capture.window = c[0]; }},
    Verb{"save-camera", 1, 1, [](const Call& c) { c.state.capture.camera = c[0]; }},
};

std::string placeOf(const ScriptCommand& command) {
  return "line " + std::to_string(command.line) + ": " + command.verb;
}

std::string placeOfLast(const Script& script) {
  return script.next > 0 ? placeOf(script.commands[script.next - 1]) : "before line 1";
}

// A wrong value is no wrong command line.
ErrorKind kindOf(const Error& error) { return error.kind == ErrorKind::usage ? ErrorKind::badData : error.kind; }

const Verb* findVerb(std::string_view name, std::span<const Verb> more) {
  for (const std::span<const Verb> verbs :
       {std::span<const Verb>(kVerbs), cameraVerbs(), displayVerbs(), editVerbs(), settingVerbs(), more}) {
    const auto at = std::find_if(verbs.begin(), verbs.end(), [name](const Verb& verb) { return verb.name == name; });
    if (at != verbs.end()) return &*at;
  }
  return nullptr;
}

}  // namespace

Script readScript(const std::filesystem::path& path, std::span<const Verb> more) {
  const std::vector<std::uint8_t> bytes = readFile(path, kMaxScriptBytes);
  return parseScript(std::string(bytes.begin(), bytes.end()), path.string(), more);
}

Script parseScript(const std::string& text, const std::string& path, std::span<const Verb> more) {
  Script script;
  script.path = path;
  script.more = more;
  std::istringstream lines(text);
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    std::istringstream words(line);
    ScriptCommand command;
    command.line = number;
    if (!(words >> command.verb) || command.verb[0] == '#') continue;
    for (std::string word; words >> word && word[0] != '#';) command.words.push_back(word);
    const std::string at = "line " + std::to_string(number) + ": ";
    const Verb* verb = findVerb(command.verb, more);
    if (!verb) throw Error(ErrorKind::badData, path, at + "unknown command \"" + command.verb + "\"");
    if (verb->words != command.words.size()) {
      throw Error(ErrorKind::badData, path,
                  at + command.verb + " (expected " + std::to_string(verb->words) + " words, found " +
                      std::to_string(command.words.size()) + ")");
    }
    if (!script.commands.empty() && script.commands.back().verb == "repeat") {
      throw Error(ErrorKind::badData, path, at + command.verb + " comes after repeat (expected as the last command)");
    }
    script.commands.push_back(std::move(command));
  }
  return script;
}

std::optional<glm::ivec2> step(Script& script, ViewerState& state) {
  if (script.wait > 0) --script.wait;
  const std::string& shown = state.messages.error;
  const bool decides = script.next == 0 && !script.commands.empty() && script.commands[0].verb == "keep-going";
  if (script.wait == 0 && !decides && !script.keeps_going && !shown.empty() && shown != script.error) {
    throw Error(ErrorKind::badData, script.path, placeOfLast(script) + ": " + shown);
  }
  while (script.wait == 0 && script.next < script.commands.size()) {
    const ScriptCommand& command = script.commands[script.next];
    const Verb& verb = *findVerb(command.verb, script.more);
    const std::string at = placeOf(command);
    try {
      if (verb.ready && !verb.ready(state)) return std::nullopt;
      const bool awaits = command.verb == "await" || command.verb == "await-file";
      if (awaits && !arrived(script, state, command, at)) return std::nullopt;
      ++script.next;
      script.wait = verb.wait;
      if (command.verb == "wait") script.wait = static_cast<int>(parseCount(command.words[0], 1, kMostFrames, at));
      if (command.verb == "repeat" && ++script.rounds < parseCount(command.words[0], 1, kMostRounds, at)) {
        script.next = 0;
      }
      if (command.verb == "keep-going") script.keeps_going = parseSwitch(command.words[0], at);
      if (command.verb == "size") return parseSize(command.words[0], at);
      if (verb.run) verb.run({state, command.words, at});
      if (verb.setting) verb.setting->set(state.display.settings, command.words[0], at);
    } catch (const Error& error) {
      const std::string what = error.what();
      throw Error(kindOf(error), script.path, what.starts_with(at) ? what : at + ": " + what);
    }
  }
  const bool ended = script.wait == 0 && script.next == script.commands.size();
  if (ended && !state.record.wanted) state.quit = true;
  return std::nullopt;
}

void failAtLast(const Script& script, const Error& error) {
  throw Error(kindOf(error), script.path, placeOfLast(script) + ": " + error.what());
}

}  // namespace tg
