// SPDX-License-Identifier: Apache-2.0
// The panels without a window: Dear ImGui draws them into nothing, and a pointer goes over all of it.
#include "viewer/panels/panels.h"

#include <fcntl.h>
#include <imgui.h>
#include <imgui_internal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <string_view>

#include "core/tiny_model.h"
#include "support/catch.h"
#include "support/temporary_folder.h"
#include "viewer/panels/sections.h"
#include "viewer/panels/widgets.h"
#include "viewer/view/actions.h"
#include "viewer/view/bookmarks.h"
#include "viewer/view/edits.h"
#include "viewer/view/parse.h"
#include "viewer/view/path_editor.h"

using namespace tg;

namespace {

class Interface {
 public:
  Interface() {
    ImGuiIO& io = ImGui::GetIO();
    io.IniFilename = nullptr;
    io.DisplaySize = {kWidth, kHeight};
#if IMGUI_VERSION_NUM < 18700
    for (int key = 0; key < ImGuiKey_COUNT; ++key) io.KeyMap[key] = key;
#endif
    unsigned char* pixels = nullptr;
    int width = 0, height = 0;
    io.Fonts->GetTexDataAsAlpha8(&pixels, &width, &height);
  }

  // The widget under the pointer, which presses or not; 0: none.
  ImGuiID hovered(ViewerState& state, ImVec2 pointer, bool pressed = false) const {
    ImGui::GetIO().MousePos = pointer;
    ImGui::GetIO().MouseDown[0] = pressed;
    ImGui::GetIO().DeltaTime = 0.01f;
    ImGui::NewFrame();
    drawPanels(state, {{4, 5}, {{"blend", 3}}, "device", {64, 48}}, false);
    ImGui::EndFrame();
    return context_->HoveredId;
  }
  // A key goes down and up, in a frame each.
  void press(ViewerState& state, ImGuiKey key) const {
    for (const bool down : {true, false}) {
#if IMGUI_VERSION_NUM < 18700
      ImGui::GetIO().KeysDown[key] = down;
#else
      ImGui::GetIO().AddKeyEvent(key, down);
#endif
      (void)hovered(state, {-1, -1});
    }
  }
  // All words of the panel.
  std::string text(ViewerState& state) const {
    return wordsOf([&] { drawPanels(state, {{4, 5}, {{"blend", 3}}, "device", {64, 48}}, false); });
  }
  // Those of the dialog or question that is open.
  std::string dialogText(ViewerState& state) const {
    return wordsOf([&] { dialogs(state, false); });
  }
  ImGuiID active() const { return context_->ActiveId; }

  static constexpr float kWidth = 900, kHeight = 1000;

 private:
  // Of the first window that `draw` draws.
  template <typename Draw>
  static std::string wordsOf(Draw draw) {
    ImGui::GetIO().MousePos = {-1, -1};
    ImGui::NewFrame();
    ImGui::LogToClipboard();
    draw();
    ImGui::EndFrame();
    const char* words = ImGui::GetClipboardText();
    return words ? words : "";
  }

  struct Destroy {
    void operator()(ImGuiContext* context) const { ImGui::DestroyContext(context); }
  };
  const std::unique_ptr<ImGuiContext, Destroy> context_{ImGui::CreateContext()};
};

// A few frames: scroll bars and tables settle. Two widgets of one name would end the program.
void drawn(ViewerState& state) {
  const Interface interface;
  for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
}

ViewerState bareState() {
  Scene scene;
  scene.path = "tiny.tgz";
  scene.model = std::make_shared<GaussianModel>(tinyTexturedModel(6));
  scene.gaussians = 6;
  scene.textured = 4;
  scene.texture_mode = TextureMode::rgba;
  scene.bounds = sceneBounds(*scene.model);
  ViewerState state;
  setScene(state, scene);
  return state;
}

// With as many widgets as there are.
ViewerState fullState() {
  ViewerState state = bareState();
  state.scene.cameras = {lookAt({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, 0.8, 64, 48)};
  state.scene.warnings = {"a warning"};
  for (const char* path : {"tiny.tgz", "other.tgz"}) {
    state.documents.open.emplace_back().path = path;
    state.documents.open.back().scene = state.scene;
  }
  state.documents.shown = 0;
  state.recent = {"tiny.tgz"};
  for (int i = 0; i < 3; ++i) {
    addBookmark(state);
    addKey(state);
  }
  state.display.crop = true;
  state.inspect.inspected = true;
  state.inspect.hits.resize(3);
  for (PixelHit& hit : state.inspect.hits) hit.t = ++state.inspect.picked;
  state.compare.photographs = "photographs";
  state.follow.active = true;
  return state;
}

// What scrolls the page: in low windows it is all of the panel.
const ImGuiWindow& pageWindow() {
  const ImGuiWindow* all = nullptr;
  for (const ImGuiWindow* window : ImGui::GetCurrentContext()->Windows) {
    const std::string_view name(window->Name);
    if (!window->Active || name.find("/all") == std::string_view::npos) continue;
    if (name.find("/page") != std::string_view::npos) return *window;
    all = window;
  }
  REQUIRE(all);
  return *all;
}

// A place of each widget of the panel.
std::map<ImGuiID, ImVec2> widgets(ViewerState state) {
  std::map<ImGuiID, ImVec2> places;
  const Interface interface;
  for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
  const float width = panelWidth(state, Interface::kWidth);
  for (float y = 1; y < Interface::kHeight; y += 7) {
    for (float x = 1; x < width; x += 9) {
      if (const ImGuiID id = interface.hovered(state, {x, y})) places.try_emplace(id, ImVec2(x, y));
    }
  }
  return places;
}

// What the pointer is over in a frame that is recorded as the window's are.
ImGuiID recordedFrame(const Interface& interface, ViewerState& state, ImVec2 at, bool pressed) {
  const ImGuiID over = interface.hovered(state, at, pressed);
  if (sliderIsPutBack()) forgetLastStep(state);
  recordChanges(state, pressed || ImGui::IsAnyItemActive(), false);
  return over;
}

}  // namespace

#if defined(TG_ASSERTS) || !defined(NDEBUG)
TEST_CASE("two widgets of one name in a window are refused, the same name elsewhere is not") {
  const TemporaryFolder folder;
  const auto ended = [&](bool twice) {
    const pid_t child = ::fork();
    REQUIRE(child >= 0);
    if (child == 0) {
      std::signal(SIGABRT, SIG_DFL);
      if (::dup2(::creat((folder / "said").c_str(), 0600), STDERR_FILENO) < 0) ::_exit(2);
      const Interface interface;
      for (int frame = 0; frame < 2; ++frame) {
        ImGui::NewFrame();
        for (const char* window : {"planted", "another"}) {
          ImGui::Begin(window);
          ImGui::Button("twin");
          if (twice) ImGui::Button("twin");
          ImGui::End();
        }
        ImGui::EndFrame();
      }
      ::_exit(0);
    }
    int status = 0;
    REQUIRE(::waitpid(child, &status, 0) == child);
    return status;
  };
  CHECK(ended(false) == 0);
  const int status = ended(true);
  REQUIRE(WIFSIGNALED(status));
  CHECK(WTERMSIG(status) == SIGABRT);
  std::ifstream said(folder / "said");
  std::string line;
  std::getline(said, line);
  CHECK_THAT(line, Contains("broken promise: a widget's name is its own in its window: planted, at"));
}
#endif

TEST_CASE("no two widgets of a page share an ID: the second of them could not be clicked") {
  // Each mode of comparing is met, and each kind of output: numbers, textures, the others.
  constexpr std::array kOutputs = {Output::final, Output::depth, Output::texture};
  for (const Tab tab : valuesOf<Tab>()) {
    for (const CompareMode mode : valuesOf<CompareMode>()) {
      INFO(name(tab) << ", " << name(mode));
      ViewerState bare = bareState(), full = fullState();
      bare.ui.tab = full.ui.tab = tab;
      full.compare.how.mode = mode;
      full.display.output = kOutputs[static_cast<std::size_t>(mode) % kOutputs.size()];
      full.display.scale = ValueScale{1, 2};
      full.record.wanted = tab == Tab::path;
      full.edit.tool = full.record.wanted ? EditTool::none : EditTool::turn;
      chooseAll(full);
      drawn(bare);
      drawn(full);
    }
  }
}

TEST_CASE("no two widgets of the welcome, a dialog or the question share an ID") {
  const TemporaryFolder folder;
  for (const char* name : {"a.tgz", "b.ply", "c.spz"}) std::ofstream(folder / name) << "abc";
  ViewerState welcome;
  welcome.recent = {"/models/one.tgz", "/models/two.tgz", "/others/one.tgz"};
  drawn(welcome);
  for (const bool saves : {false, true}) {
    ViewerState state = fullState();
    FileDialog& dialog = state.desktop.dialog.emplace();
    dialog.use = saves ? FileUse::saveModel : FileUse::open;
    dialog.browser.saves = saves;
    dialog.browser.types = {{".tgz", ""}, {".ply", "Holds no textures"}, {".spz", ""}};
    enterFolder(dialog.browser, folder.path);
    drawn(state);
    CHECK(state.desktop.dialog);  // looking at it chooses nothing
  }
  for (const Unsaved what : {Unsaved::path, Unsaved::bookmarks, Unsaved::edits, Unsaved::run}) {
    ViewerState state = fullState();
    state.desktop.question = ClosingQuestion{{}, what, "tiny.tgz"};
    drawn(state);
    CHECK(state.desktop.question);
  }
}

TEST_CASE("every answer of the question before something is lost is given by keys") {
  // How many steps to the right, or with Tab, from the first one.
  const auto answered = [](Unsaved what, std::initializer_list<ImGuiKey> keys) {
    ViewerState state = bareState();
    state.desktop.question = ClosingQuestion{{}, what, "tiny.tgz"};
    const Interface interface;
    for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
    for (const ImGuiKey key : keys) interface.press(state, key);
    CHECK(state.desktop.question);
    interface.press(state, ImGuiKey_Enter);
    CHECK_FALSE(state.desktop.question);
    return state;
  };
  constexpr ImGuiKey kRight = ImGuiKey_RightArrow, kLeft = ImGuiKey_LeftArrow, kTab = ImGuiKey_Tab;
  CHECK(answered(Unsaved::path, {}).desktop.wanted == FileUse::savePath);
  CHECK(answered(Unsaved::path, {kRight, kLeft}).desktop.wanted == FileUse::savePath);
  CHECK(answered(Unsaved::path, {kRight, kTab, kTab}).desktop.wanted == FileUse::savePath);
  for (const auto& keys : {std::initializer_list<ImGuiKey>{kRight}, {kTab}, {kLeft, kLeft}}) {
    CHECK(answered(Unsaved::path, keys).quit);
    const ViewerState left = answered(Unsaved::run, keys);
    CHECK(left.quit);
    CHECK_FALSE(left.follow.order);
  }
  const ViewerState stays = answered(Unsaved::path, {kLeft});
  CHECK_FALSE(stays.quit);
  CHECK_FALSE(stays.desktop.wanted);
}

TEST_CASE("the answer that Enter gives is lit, and the next question begins with its first one") {
  ViewerState state = bareState();
  state.desktop.question = ClosingQuestion{{}, Unsaved::path, "tiny.tgz"};
  const Interface interface;
  const auto lit = [&] {
    for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
    const ImGuiWindow* window = ImGui::FindWindowByName("closing");
    REQUIRE(window);
    float left = Interface::kWidth;
    for (const ImDrawVert& point : window->DrawList->VtxBuffer) {
      if (point.col == ImGui::GetColorU32(kAccent)) left = std::min(left, point.pos.x);
    }
    return left;
  };
  const float first = lit();
  interface.press(state, ImGuiKey_RightArrow);
  const float second = lit();
  CHECK(second > first);
  CHECK(second < Interface::kWidth);
  addKey(state);
  state.desktop.question->what = Unsaved::run;
  interface.press(state, ImGuiKey_Enter);
  REQUIRE(state.desktop.question);
  CHECK(state.desktop.question->what == Unsaved::path);
  CHECK(lit() == Approx(first).margin(1));
}

TEST_CASE("a recording that ends while it is asked about leaves nothing to discard") {
  const auto answered = [](int steps, std::initializer_list<ImGuiKey> keys) {
    ViewerState state = bareState();
    state.record.wanted = true;
    state.record.done = 60;
    state.record.frames = 61;
    state.desktop.question = ClosingQuestion{{}, Unsaved::recording, {}};
    const Interface interface;
    for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
    for (int i = 0; i < steps; ++i) interface.press(state, ImGuiKey_RightArrow);
    const std::string before = interface.dialogText(state);
    CHECK_THAT(before, Contains("60 of 61") && Contains("Finish it first") && Contains("Discard"));
    state.record.wanted = false;
    const std::string after = interface.dialogText(state);
    CHECK_THAT(after, Contains("The recording has been written meanwhile.") && Contains("Close"));
    CHECK_THAT(after, !Contains("Discard") && !Contains("60 of 61") && !Contains("Finish"));
    for (const ImGuiKey key : keys) interface.press(state, key);
    CHECK(state.desktop.question);
    interface.press(state, ImGuiKey_Enter);
    CHECK_FALSE(state.desktop.question);
    return state.quit;
  };
  CHECK(answered(0, {}));
  CHECK_FALSE(answered(0, {ImGuiKey_RightArrow}));
  CHECK(answered(0, {ImGuiKey_LeftArrow, ImGuiKey_Tab}));
  CHECK_FALSE(answered(1, {}));  // Discard was lit
  CHECK_FALSE(answered(2, {}));
  CHECK(answered(2, {ImGuiKey_RightArrow}));
}

TEST_CASE("a press of the pointer reaches the widget that it is over, on every page") {
  for (const Tab tab : valuesOf<Tab>()) {
    INFO(name(tab));
    ViewerState state = fullState();
    state.ui.tab = tab;
    // What is grey has no press.
    chooseAll(state);
    state.history.steps.resize(2);
    for (HistoryStep& step : state.history.steps) step.name = "Step";
    state.history.done = 1;
    const std::map<ImGuiID, ImVec2> places = widgets(state);
    CHECK(places.size() > 20);
    int only_looked_at = 0;
    for (const auto& [id, place] : places) {
      INFO(place.x << ", " << place.y);
      ViewerState pressed = state;
      const Interface interface;
      for (int i = 0; i < 3; ++i) (void)interface.hovered(pressed, {-1, -1});
      (void)interface.hovered(pressed, place);
      (void)interface.hovered(pressed, place, true);
      // A menu opens at once and has the pointer from then on.
      if (interface.active() == id || popupIsOpen()) continue;
      ++only_looked_at;
      CHECK(tab == Tab::time);  // its chart
    }
    CHECK(only_looked_at <= 1);
  }
}

TEST_CASE("the panel's edge is dragged within its limits, and the picture begins where it ends") {
  ViewerState state = fullState();
  const Interface interface;
  for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
  const auto drag = [&](float to) {
    const float from = panelWidth(state, Interface::kWidth) - 3;
    (void)interface.hovered(state, {from, 300});
    (void)interface.hovered(state, {from, 300}, true);
    for (int i = 0; i < 2; ++i) (void)interface.hovered(state, {to, 300}, true);
    (void)interface.hovered(state, {to, 300});
    return panelWidth(state, Interface::kWidth);
  };
  CHECK(drag(400) == Approx(400).margin(6));
  CHECK(drag(5000) < Interface::kWidth - 200);
  CHECK(drag(5) == Approx(kLeastPanel * ImGui::GetFontSize()).margin(1));
  CHECK(state.ui.panel_width == kLeastPanel);
}

TEST_CASE("the inspector's columns hold their text and stand apart, however narrow the panel is") {
  for (const double width : {kLeastPanel, kUsualPanel, kMostPanel}) {
    INFO(width << " letters");
    ViewerState state = fullState();
    state.ui.tab = Tab::inspect;
    state.ui.panel_width = width;
    for (PixelHit& hit : state.inspect.hits) hit.weight = hit.alpha = 1, hit.t = 1.2344;
    const Interface interface;
    for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
    int columns = 0;
    ImPool<ImGuiTable>& tables = ImGui::GetCurrentContext()->Tables;
    for (int i = 0; i < tables.GetMapSize(); ++i) {
      const ImGuiTable* table = tables.TryGetMapData(i);
      if (!table || !(table->Flags & ImGuiTableFlags_ScrollY)) continue;
      for (int c = 0; c < table->ColumnsCount; ++c, ++columns) {
        const ImGuiTableColumn& column = table->Columns[c];
        CHECK(std::max(column.ContentMaxXFrozen, column.ContentMaxXUnfrozen) <= column.WorkMaxX + 0.5f);
        CHECK(std::string_view(ImGui::TableGetColumnName(table, c)).size() > 2);  // a word
        if (c > 0) CHECK(column.WorkMinX - table->Columns[c - 1].WorkMaxX >= 4);
      }
    }
    CHECK(columns >= 5);
    CHECK((width < kMostPanel || columns == 7));
  }
}

TEST_CASE("the page of the inspector has the pixel's colour and where Gaussian and hit lie in the world") {
  ViewerState state = fullState();
  state.ui.tab = Tab::inspect;
  state.ui.panel_width = kMostPanel;
  state.display.settings.background = {0, 0.5f, 1};
  state.inspect.camera = lookAt({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, 0.8, 65, 49);
  state.inspect.pixel = {32, 24};  // the middle
  state.inspect.hits.resize(1);
  PixelHit& hit = state.inspect.hits[0];
  hit.index = 3;
  hit.t = 4.5;
  hit.transmittance = 1;
  hit.weight = hit.alpha = 0.25;
  hit.base = {1, 0.5, 0};
  state.inspect.picked = 0;
  const Interface interface;
  for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
  const std::string words = interface.text(state);
  CHECK_THAT(words, Contains("colour 0.2500, 0.5000, 0.7500"));
  CHECK_THAT(words, Contains(", 0.5\n") && Contains("hit "));
  std::array<char, 80> mean{};
  const glm::vec3 m = state.scene.model->mean[3];
  std::snprintf(mean.data(), mean.size(), "mean %.5g, %.5g, %.5g", m.x, m.y, m.z);
  CHECK_THAT(words, Contains(mean.data()));
}

TEST_CASE("a drag over all of the histogram, to either end, selects every Gaussian") {
  for (std::size_t value = 0; value < selectValues().size(); ++value) {
    for (double width = kLeastPanel; width < kLeastPanel + 8; ++width) {
      CAPTURE(value, width);
      ViewerState state = fullState();
      state.scene.model = std::make_shared<GaussianModel>(tinyTexturedModel(60));
      measure(state.scene);
      state.ui.tab = Tab::edit;
      state.ui.panel_width = width;
      state.edit.value = value;
      const Interface interface;
      for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
      for (const float to : {-50.0f, Interface::kWidth}) {
        // Its place: the widget that takes a range.
        const float from = panelWidth(state, Interface::kWidth) / 2;
        for (float y = 200; y < Interface::kHeight && !state.edit.range_before; y += 20) {
          (void)interface.hovered(state, {from, y});
          (void)interface.hovered(state, {from, y}, true);
          if (!state.edit.range_before) (void)interface.hovered(state, {from, y});
          if (state.edit.range_before) (void)interface.hovered(state, {to, y}, true);
        }
        REQUIRE(state.edit.range_before);
        const Histogram* histogram = histogramShown(state);
        CHECK((to < 0 ? state.edit.low == histogram->low : state.edit.high == histogram->high));
        (void)interface.hovered(state, {to, 0});
        state.edit.range_before.reset();
      }
    }
  }
}

TEST_CASE("a part of a model leaves the page of edits grey") {
  ViewerState state = fullState();
  state.ui.tab = Tab::edit;
  const auto live = [](const ViewerState& shown) {
    int count = 0;
    for (const auto& [id, place] : widgets(shown)) {
      ViewerState pressed = shown;
      const Interface interface;
      for (int i = 0; i < 3; ++i) (void)interface.hovered(pressed, {-1, -1});
      (void)interface.hovered(pressed, place);
      (void)interface.hovered(pressed, place, true);
      count += interface.active() == id;
    }
    return count;
  };
  const int whole = live(state);
  for (const bool levels : {false, true}) {
    ViewerState part = state;
    levels ? void(part.scene.streamed_from = 1000) : void(part.scene.partial = true);
    CHECK(live(part) <= whole - 15);
  }
}

TEST_CASE("a notice that is longer than the window is wide stays inside") {
  ViewerState state = bareState();
  const Interface interface;
  for (const std::size_t letters : {3, 300}) {
    notify(state, std::string(letters, 'x'));
    for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
    const ImGuiWindow* window = ImGui::FindWindowByName("notice");
    REQUIRE(window);
    CHECK(window->Pos.x >= panelWidth(state, Interface::kWidth));
    CHECK(window->Pos.x + window->Size.x <= Interface::kWidth);
    CHECK(window->ContentSize.x <= window->Size.x);
    CHECK(window->ContentSize.y <= window->Size.y);
  }
}

TEST_CASE("words over the picture leave the panel's buttons free in a narrow window") {
  ViewerState state;
  state.ui.panel = true;
  state.messages.error = "no room";
  notify(state, "Saved /a/folder/with/a/long/name/model-001.png");
  const Interface interface;
  ImGui::GetIO().DisplaySize = {500, 400};
  for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
  const float width = panelWidth(state, 500);
  for (const char* name : {"notice", "error", "welcome"}) {
    INFO(name);
    const ImGuiWindow* window = ImGui::FindWindowByName(name);
    REQUIRE(window);
    CHECK(window->Pos.x >= width - 1);
    CHECK(window->Pos.x + window->Size.x <= 500);
  }
}

TEST_CASE("buttons over the picture close the help, and have a file read again or the one shown kept") {
  ViewerState state = fullState();
  const Interface interface;
  // Over the whole window, until `done`.
  const auto pressUntil = [&](const char* name, const auto& done) {
    for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
    const ImGuiWindow* window = ImGui::FindWindowByName(name);
    REQUIRE(window);
    const ImVec2 corner = window->Pos, size = window->Size;
    for (float y = 4; y < size.y; y += 6) {
      for (float x = 4; x < size.x && !done(); x += 12) {
        const ImVec2 at(corner.x + x, corner.y + y);
        for (const bool pressed : {false, true, false}) (void)interface.hovered(state, at, pressed);
      }
    }
    CHECK(done());
  };
  state.ui.help = true;
  pressUntil("help", [&] { return !state.ui.help; });
  state.documents.open[0].rewritten = true;
  pressUntil("rewritten", [&] { return !state.documents.open_requests.empty(); });
  CHECK(state.documents.open_requests.front() == "tiny.tgz");
  CHECK(state.documents.open[0].rewritten);  // until it is there
  pressUntil("rewritten", [&] { return !state.documents.open[0].rewritten; });
}

TEST_CASE("the panel covers nothing of a picture that finds room beside it") {
  ViewerState state = fullState();
  const Interface interface;
  ImGui::GetIO().DisplaySize = {500, 400};
  for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
  CHECK(panelWidth(state, 500) > 200);
  CHECK(panelWidth(state, 400) == 0);
}

TEST_CASE("a hint that is longer than the window is wide stays inside, as does a long name") {
  ViewerState state;
  state.recent = {"/" + std::string(300, 'x') + "/" + std::string(200, 'y') + ".tgz"};
  const Interface interface;
  for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
  const ImGuiWindow* welcome = ImGui::FindWindowByName("welcome");
  REQUIRE(welcome);
  const ImVec2 row(welcome->Pos.x + welcome->Size.x / 2, welcome->Pos.y + welcome->Size.y - 14);
  for (int i = 0; i < 3; ++i) (void)interface.hovered(state, row);
  CHECK_FALSE(ImGui::FindWindowByName("##Tooltip_00"));  // not at once
  CHECK(isFading());
  for (int i = 0; i < 50; ++i) (void)interface.hovered(state, row);  // of 0.01 s
  CHECK_FALSE(isFading());
  const ImGuiWindow* hint = ImGui::FindWindowByName("##Tooltip_00");
  REQUIRE(hint);
  CHECK(hint->Pos.x >= 0);
  CHECK(hint->Pos.x + hint->Size.x <= Interface::kWidth);
  CHECK(hint->ContentSize.y > 2 * ImGui::GetFontSize());  // lines
  CHECK(welcome->Pos.x + welcome->Size.x <= Interface::kWidth);
}

TEST_CASE("hints over words wait, too, and an empty or disabled field of a recording has its hint") {
  for (const int field : {0, 1, 2}) {
    INFO(field);
    ViewerState state = bareState();
    state.ui.tab = Tab::path;
    if (field == 1) state.record.out = "";
    state.record.wanted = field == 2;
    const Interface interface;
    for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
    bool found = false;
    for (float y = 2; y < 700 && !found; y += 6) {
      for (int i = 0; i < 2; ++i) {
        const ImGuiID over = interface.hovered(state, {60, y});
        const ImGuiID page = ImHashStr("page", 0, pageWindow().ID);
        found = field == 0 ? over == 0 && isFading() : over == ImHashStr("##out", 0, page);
      }
      if (!found) continue;
      const auto shown = [] {
        const ImGuiWindow* hint = ImGui::FindWindowByName("##Tooltip_00");
        return hint && hint->Active;
      };
      CHECK_FALSE(shown());
      for (int i = 0; i < 60; ++i) (void)interface.hovered(state, {60, y});
      CHECK(shown());
      CHECK_FALSE(isFading());
    }
    CHECK(found);
  }
}

TEST_CASE("outputs are buttons to click once there is a model") {
  for (const bool there : {false, true}) {
    INFO(there);
    ViewerState state = there ? bareState() : ViewerState();
    const Interface interface;
    for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
    const ImGuiWindow& page = pageWindow();
    const ImVec2 corner = page.Pos;
    std::set<Output> shown;
    for (float y = corner.y; y < corner.y + 100; y += 8) {
      for (float x = corner.x; x < corner.x + page.Size.x; x += 16) {
        for (const bool pressed : {false, true, false}) (void)interface.hovered(state, {x, y}, pressed);
        shown.insert(state.display.output);
      }
    }
    CHECK(shown.size() == (there ? static_cast<std::size_t>(kCount<Output>) : 1));
  }
}

TEST_CASE("the list of keys keeps letters that can be read, scrolls where it has no room, and ends in the window") {
  ViewerState state = bareState();
  state.ui.help = true;
  const Interface interface;
  for (const auto& [size, fine] :
       {std::pair(ImVec2(640, 480), 1), {ImVec2(320, 200), 1}, {ImVec2(1900, 1400), 1}, {ImVec2(1280, 800), 2}}) {
    CAPTURE(size.x);
    ImGui::GetIO().DisplaySize = size;
    ImGui::GetIO().FontGlobalScale = static_cast<float>(fine);
    for (int i = 0; i < 4; ++i) (void)interface.hovered(state, {-1, -1});
    const ImGuiWindow* window = ImGui::FindWindowByName("help");
    REQUIRE(window);
    CHECK(window->FontWindowScale * ImGui::GetFontSize() >= 11 * static_cast<float>(fine));
    CHECK(window->Size.x <= size.x);
    CHECK(window->Size.y <= size.y);
    CHECK(window->ScrollbarY == (size.y < 1000));
    CHECK(window->ContentSize.x <= window->Size.x);
    ImGuiTable* table = ImGui::TableFindByID(ImHashStr("keys", 0, window->ID));
    REQUIRE(table);
    for (int i = 0; i < table->ColumnsCount; ++i) {
      CHECK(table->Columns[i].ContentMaxXUnfrozen <= table->Columns[i].ClipRect.Max.x + 1);
    }
  }
}

TEST_CASE(
    "Page Down and Page Up scroll the list of keys where it has no room, and only there are not those of models") {
  ViewerState state = fullState();
  state.ui.help = true;
  const Interface interface;
  for (const bool low : {true, false}) {
    INFO(low);
    ImGui::GetIO().DisplaySize = low ? ImVec2(640, 300) : ImVec2(1900, 1400);
    for (int i = 0; i < 4; ++i) (void)interface.hovered(state, {-1, -1});
    const ImGuiWindow* window = ImGui::FindWindowByName("help");
    REQUIRE(window);
    const auto scrolled = [&](int key) {
      state.documents.show_request.reset();
      CHECK(pressKey(state, key, false));
      CHECK(state.documents.show_request.has_value() != low);
      for (int i = 0; i < 2; ++i) (void)interface.hovered(state, {-1, -1});
      return window->Scroll.y;
    };
    const float down = scrolled(kKeyPageDown);
    CHECK((down > 0) == low);
    CHECK(down < window->Size.y);
    if (low) CHECK(scrolled(kKeyPageDown) > down);
    for (int i = 0; i < 9; ++i) scrolled(kKeyPageUp);
    CHECK(window->Scroll.y == 0);
  }
  state.ui.help_scrolls = true;
  state.ui.help = false;
  CHECK(pressKey(state, kKeyPageDown, false));
  CHECK(state.documents.show_request);
}

TEST_CASE("a text is cut in its middle, between letters, to the room that there is") {
  const Interface interface;
  ViewerState state = bareState();
  (void)interface.hovered(state, {-1, -1});
  ImGui::NewFrame();
  ImGui::Begin("text");
  const std::string name = "trained_\xc3\xa4\xc3\xb6\xc3\xbc_with_a_name_that_is_long.tgz";
  const auto widthOf = [](const std::string& text) { return ImGui::CalcTextSize(text.c_str()).x; };
  CHECK(cutMiddle(name, widthOf(name)) == name);
  for (float room = widthOf("..."); room < widthOf(name); room += 5) {
    const std::string cut = cutMiddle(name, room);
    CAPTURE(room, cut);
    const std::size_t dots = cut.find("...");
    REQUIRE(dots != std::string::npos);
    CHECK(widthOf(cut) <= room);
    CHECK(name.starts_with(cut.substr(0, dots)));
    CHECK(name.ends_with(cut.substr(dots + 3)));
    CHECK((static_cast<unsigned char>(name[dots]) & 0xC0) != 0x80);
    const std::size_t right = name.size() - (cut.size() - dots - 3);
    if (right < name.size()) CHECK((static_cast<unsigned char>(name[right]) & 0xC0) != 0x80);
  }
  ImGui::End();
  ImGui::EndFrame();
}

TEST_CASE("the buttons of textures can be clicked where one of two models beside each other has textures") {
  for (const bool beside : {false, true}) {
    INFO(beside);
    ViewerState state = fullState();
    state.scene.textured = 0;
    if (beside) state.compare.how.mode = CompareMode::side;
    const Interface interface;
    for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
    const ImGuiWindow& page = pageWindow();
    std::set<TextureMode> chosen;
    for (float y = page.Pos.y; y < page.Pos.y + 250; y += 8) {
      for (float x = page.Pos.x; x < page.Pos.x + page.Size.x; x += 16) {
        for (const bool pressed : {false, true, false}) (void)interface.hovered(state, {x, y}, pressed);
        chosen.insert(state.display.settings.textures);
      }
    }
    CHECK(chosen.size() == (beside ? static_cast<std::size_t>(kCount<TextureMode>) : 1));
  }
}

TEST_CASE("the page stays where it is through all ways to compare and all that is said of them") {
  ViewerState state = fullState();
  const Interface interface;
  std::set<float> tops;
  for (const CompareMode mode : valuesOf<CompareMode>()) {
    state.compare.how.mode = mode;
    for (const int said : {0, 1, 2, 3}) {
      state.compare.problem = said == 1 ? std::string(200, 'x') : "";
      state.compare.metrics.reset();
      if (said == 2) state.compare.metrics = PictureMetrics{31.25, 0.9, 0.1};
      state.compare.measured = said == 3;
      for (int i = 0; i < 2; ++i) (void)interface.hovered(state, {-1, -1});
      tops.insert(pageWindow().Pos.y);
    }
  }
  CHECK(tops.size() == 1);
}

TEST_CASE("figures are grey until they are those of the picture, and are none where they would mean nothing") {
  ViewerState state = fullState();
  state.ui.tab = Tab::edit;
  state.compare.how.mode = CompareMode::wipe;
  state.compare.metrics = PictureMetrics{31.25, 0.9, 0.1};
  const Interface interface;
  const auto grey = [&] {
    for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
    std::ptrdiff_t count = 0;
    for (const ImGuiWindow* window : ImGui::GetCurrentContext()->Windows) {
      const auto& points = window->DrawList->VtxBuffer;
      count += std::ranges::count(points, ImGui::GetColorU32(ImGuiCol_TextDisabled), &ImDrawVert::col);
    }
    return count;
  };
  const std::ptrdiff_t stale = grey();
  state.compare.measured = true;
  CHECK(grey() < stale);
  CHECK_THAT(interface.text(state), Contains("PSNR 31.25 dB") && Contains("SSIM 0.9000"));
  state.display.output = Output::depth;
  CHECK_THAT(interface.text(state), Contains("Colours 31.25 dB") && !Contains("PSNR"));
  state.inspect.isolated = true;
  CHECK_THAT(interface.text(state), Contains("no figures of one") && !Contains("31.25"));
  state.inspect.isolated = false;
  state.compare.with_photographs = true;
  CHECK_THAT(interface.text(state), Contains("no figures") && !Contains("31.25"));
}

TEST_CASE("a recording says how far it is on every page") {
  for (const Tab tab : valuesOf<Tab>()) {
    INFO(name(tab));
    ViewerState state = bareState();
    state.ui.tab = tab;
    state.record.out = "/a/folder/" + std::string(200, 'x') + "/turn.mp4";
    const Interface interface;
    for (const bool records : {false, true}) {
      state.record.wanted = records;
      state.record.frames = 120;
      state.record.done = 7;
      for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
      const ImGuiWindow* window = ImGui::FindWindowByName("recording");
      REQUIRE((window != nullptr) == records);
      if (!records) continue;
      CHECK(window->Pos.x >= panelWidth(state, Interface::kWidth));
      CHECK(window->Pos.x + window->Size.x <= Interface::kWidth);
      CHECK(window->ContentSize.x <= window->Size.x);
    }
  }
}

TEST_CASE("a tool is at work in either of two pictures beside each other, and its drag stays in the one it began in") {
  ViewerState state = bareState();
  state.compare.how.mode = CompareMode::side;
  setTool(state, EditTool::rectangle);
  const Interface interface;
  const auto frame = [&](ImVec2 at, bool pressed) {
    ImGui::GetIO().MousePos = at;
    ImGui::GetIO().MouseDown[0] = pressed;
    ImGui::NewFrame();
    const bool taken = editInput(state).button;
    drawPanels(state, {{4, 5}, {{"blend", 3}}, "device", {64, 48}}, false);
    ImGui::EndFrame();
    return taken;
  };
  for (int i = 0; i < 3; ++i) frame({-1, -1}, false);
  const float left = panelWidth(state, Interface::kWidth);
  const float half = std::floor((Interface::kWidth - left) / 2);
  const auto drawnAt = [](float x) {
    const ImVector<ImDrawVert>& points = ImGui::GetBackgroundDrawList()->VtxBuffer;
    return std::ranges::any_of(points, [x](const ImDrawVert& point) { return std::abs(point.pos.x - x) < 1; });
  };
  std::vector<SelectionPtr> selected;
  for (const float begin : {left, left + half}) {
    INFO(begin);
    chooseNone(state);
    frame({begin + 1, 10}, false);
    CHECK(frame({begin + 1, 10}, true));
    CHECK(frame({begin + half - 60, 900}, true));
    REQUIRE(state.edit.selecting);
    CHECK(state.edit.selecting->from == glm::dvec2(1, 10));
    CHECK(state.edit.selecting->to == glm::dvec2(half - 60, 900));
    CHECK(drawnAt(begin + half - 60));
    const float other = begin > left ? left + 20 : left + half + 20;
    frame({other, 900}, true);
    CHECK(state.edit.selecting->to == glm::dvec2(other - begin, 900));
    frame({begin + half - 60, 900}, true);
    frame({begin + half - 60, 900}, false);
    CHECK_FALSE(state.edit.selecting);
    selected.push_back(state.edit.selection);
  }
  REQUIRE(selected[0]);
  REQUIRE(selected[1]);
  CHECK(selected[0]->chosen == selected[1]->chosen);
}

TEST_CASE("the panel says where photographs have a lens, and of models nothing of it") {
  ViewerState state = fullState();
  state.compare.photographs_have_lens = state.compare.with_photographs = true;
  const Interface interface;
  CHECK_THAT(interface.text(state), Contains("photographs have a lens"));
  state.compare.with_photographs = false;
  CHECK_THAT(interface.text(state), !Contains("have a lens"));
}

TEST_CASE("the half that has no picture beside the model's says why") {
  ViewerState state = bareState();
  state.compare.how.mode = CompareMode::side;
  const Interface interface;
  const auto drawnBehind = [&] {
    for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
    const ImVector<ImDrawVert>& points = ImGui::GetBackgroundDrawList()->VtxBuffer;
    const float left = panelWidth(state, Interface::kWidth);
    for (const ImDrawVert& point : points) CHECK(point.pos.x > (left + Interface::kWidth) / 2);
    return points.Size;
  };
  state.compare.problem = "No photograph was taken from here";
  for (const bool panel : {true, false}) {
    state.ui.panel = panel;
    CHECK(drawnBehind() > 0);
  }
  state.compare.how.mode = CompareMode::flicker;
  CHECK(drawnBehind() == 0);
}

TEST_CASE("pictures of a recording carry nothing of a comparison") {
  ViewerState state = bareState();
  const Interface interface;
  const auto drawnBehind = [&] {
    for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
    return ImGui::GetBackgroundDrawList()->VtxBuffer.Size;
  };
  for (const CompareMode mode : valuesOf<CompareMode>()) {
    INFO(name(mode));
    state.compare.how.mode = CompareMode::off;
    state.record.wanted = true;
    state.record.waits = false;
    state.display.output = Output::texture;
    const int legend = drawnBehind();  // of the output: such pictures are recorded
    CHECK(legend > 0);
    state.compare.how.mode = mode;
    CHECK(drawnBehind() == legend);
    state.display.output = Output::final;
    CHECK(drawnBehind() == 0);
    if (mode == CompareMode::side) {
      state.compare.problem = "No photograph was taken from here";
      CHECK(drawnBehind() == 0);
      state.record.waits = true;  // the view is back
      CHECK(drawnBehind() > 0);
      state.record.waits = false;
      state.compare.problem.clear();
    }
    state.record.wanted = false;
    CHECK((drawnBehind() > 0) == (mode != CompareMode::off));
  }
}

TEST_CASE("a window that is too low for what stands above a page scrolls it with the page") {
  ViewerState state = fullState();
  const Interface interface;
  for (const float height : {1000.0f, 400.0f}) {
    INFO(height);
    ImGui::GetIO().DisplaySize.y = height;
    for (int i = 0; i < 4; ++i) (void)interface.hovered(state, {-1, -1});
    const ImGuiWindow& page = pageWindow();
    CHECK(page.Size.y > 200);
    CHECK((page.Pos.y < 60) == (height < 500));
    if (height < 500) CHECK(page.ScrollMax.y > 200);
  }
}

TEST_CASE("a list of warnings that is opened in a low window stays open and leaves the page in one place") {
  for (float height = 400; height <= 560; height += 10) {
    INFO(height);
    ViewerState state = fullState();
    state.scene.warnings.assign(3, std::string(90, 'x') + " " + std::string(90, 'y'));
    const Interface interface;
    ImGui::GetIO().DisplaySize.y = height;
    for (int i = 0; i < 4; ++i) (void)interface.hovered(state, {-1, -1});
    bool opened = false;
    for (float y = 0; y < height && !opened; y += 4) {
      const ImGuiID over = interface.hovered(state, {60, y});
      opened = over != 0 && std::ranges::any_of(ImGui::GetCurrentContext()->Windows,
                                                [&](ImGuiWindow* window) { return window->GetID("warnings") == over; });
      for (const bool pressed : {true, false}) {
        if (opened) (void)interface.hovered(state, {60, y}, pressed);
      }
    }
    REQUIRE(opened);
    for (int i = 0; i < 4; ++i) (void)interface.hovered(state, {-1, -1});
    std::set<std::pair<float, float>> places;
    for (int i = 0; i < 4; ++i) {
      (void)interface.hovered(state, {-1, -1});
      places.emplace(pageWindow().Pos.y, pageWindow().Size.y);
    }
    CHECK(places.size() == 1);
  }
}

TEST_CASE("a slider of the page is held on while a head that grows leaves the page little room") {
  ViewerState state = fullState();
  state.ui.tab = Tab::camera;
  const Interface interface;
  ImGui::GetIO().DisplaySize.y = 700;
  for (int i = 0; i < 4; ++i) (void)interface.hovered(state, {-1, -1});
  const ImVec2 corner = pageWindow().Pos;
  ImGuiID held = 0;
  ImVec2 place;
  for (float y = corner.y; y < corner.y + 150 && held == 0; y += 4) {
    place = {corner.x + 20, y};
    for (int i = 0; i < 2; ++i) (void)interface.hovered(state, place);
    (void)interface.hovered(state, place, true);
    held = interface.active();
    if (held == 0) (void)interface.hovered(state, place);
  }
  REQUIRE(held != 0);
  state.follow.problem = std::string(300, 'x') + " " + std::string(300, 'y');
  ImGui::GetIO().DisplaySize.y = 400;
  for (int i = 0; i < 3; ++i) (void)interface.hovered(state, place, true);
  CHECK(interface.active() == held);
  for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
  CHECK(pageWindow().Pos.y < 60);
}

TEST_CASE("a double click on a slider opens a field with the value from before it") {
  ViewerState state = bareState();
  const Interface interface;
  const auto open = [&](Tab tab, const char* name, const auto& untouched) {
    INFO(name);
    state.ui.tab = tab;
    for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
    const ImGuiWindow& page = pageWindow();
    const ImGuiID id = ImHashStr(name, 0, ImHashStr("page", 0, page.ID));
    ImVec2 place(page.Pos.x + page.Size.x - 20, page.Pos.y);
    while (place.y < Interface::kHeight && interface.hovered(state, place) != id) place.y += 4;
    for (const bool pressed : {true, false}) (void)interface.hovered(state, place, pressed);
    CHECK_FALSE(untouched());
    for (const bool pressed : {true, false}) (void)interface.hovered(state, place, pressed);
    CHECK(untouched());
    CHECK(interface.active() == id);
    CHECK(ImGui::GetIO().WantTextInput);
  };
  state.camera.speed = 1.25;
  open(Tab::camera, "##speed", [&] { return state.camera.speed == 1.25; });
  ImGui::GetIO().AddInputCharacter('3');
  (void)interface.hovered(state, {-1, -1});
  CHECK(state.camera.speed == 3);
  // Elsewhere, and a slider of 64 bits.
  for (const bool pressed : {false, true, false}) (void)interface.hovered(state, {600, 500}, pressed);
  state.scene.streamed_from = 1'000'000;
  state.stream.budget = 1'000;
  open(Tab::view, "##budget", [&] { return state.stream.budget == 1'000; });
}

TEST_CASE("a drag of a slider is one step, and so is a double click with what is typed then") {
  ViewerState state = bareState();
  state.ui.tab = Tab::camera;
  state.camera.speed = 1.25;
  const Interface interface;
  const auto frame = [&](ImVec2 at, bool pressed) { return recordedFrame(interface, state, at, pressed); };
  for (int i = 0; i < 3; ++i) frame({-1, -1}, false);
  const ImGuiWindow& page = pageWindow();
  const ImGuiID id = ImHashStr("##speed", 0, ImHashStr("page", 0, page.ID));
  ImVec2 place(page.Pos.x + page.Size.x - 20, page.Pos.y);
  while (place.y < Interface::kHeight && frame(place, false) != id) place.y += 4;
  const ImVec2 left(place.x - 60, place.y);
  frame(place, true);
  for (const bool pressed : {true, true, false}) frame(left, pressed);
  const double dragged = state.camera.speed;
  const std::size_t steps = state.history.steps.size();
  CHECK(steps == 1);
  for (int i = 0; i < 60; ++i) frame({600, 500}, false);  // longer than a double click
  for (const bool pressed : {true, false, true, false}) frame(place, pressed);
  CHECK(state.camera.speed == dragged);
  CHECK(state.history.steps.size() == steps);
  ImGui::GetIO().AddInputCharacter('3');
  frame({-1, -1}, false);
  for (const bool pressed : {false, true, false}) frame({600, 500}, pressed);
  CHECK(state.camera.speed == 3);
  CHECK(state.history.steps.size() == steps + 1);
  undo(state);
  CHECK(state.camera.speed == dragged);
  undo(state);
  CHECK(state.camera.speed == 1.25);
}

TEST_CASE("a double click on a slider that has no steps leaves the last one alone") {
  ViewerState state = bareState();
  setTool(state, EditTool::brush);
  state.ui.tab = Tab::edit;
  const Interface interface;
  const auto frame = [&](ImVec2 at, bool pressed) { return recordedFrame(interface, state, at, pressed); };
  for (int i = 0; i < 3; ++i) frame({-1, -1}, false);
  const bool edits = GENERATE(true, false);
  CAPTURE(edits);
  state.edit.selection = selectionOf(*state.scene.model, {1, 1, 0, 0, 0, 0});
  if (edits) deleteChosen(state);
  for (int i = 0; i < 3; ++i) frame({-1, -1}, false);
  const std::string name = undoName(state);
  REQUIRE(name == (edits ? "Delete 2" : "Select 2"));
  const std::size_t steps = state.history.steps.size();
  const ImGuiWindow& page = pageWindow();
  const ImGuiID id = ImHashStr("##brush", 0, ImHashStr("page", 0, page.ID));
  ImVec2 place(page.Pos.x + page.Size.x - 20, page.Pos.y);
  while (place.y < Interface::kHeight && frame(place, false) != id) place.y += 4;
  const double brush = state.edit.brush;
  for (const bool pressed : {true, false}) frame(place, pressed);
  REQUIRE(state.edit.brush != brush);
  for (const bool pressed : {true, false}) frame(place, pressed);
  CHECK(state.edit.brush == brush);
  CHECK(undoName(state) == name);
  CHECK(state.history.steps.size() == steps);
  undo(state);
  CHECK(state.scene.model->size() == 6);
  CHECK((state.edit.selection != nullptr) == edits);
}

TEST_CASE("fields of the crop box and of moves take finite numbers, and no corner moves the other one") {
  ViewerState state = bareState();
  state.display.crop = true;
  state.display.box = {{-1, -1, -1}, {1, 1, 1}};
  setTool(state, EditTool::move);
  state.edit.move = {0.5, 0, 0};
  const Interface interface;
  const auto type = [&](Tab tab, const char* name, const char* text) {
    INFO(name << " " << text);
    state.ui.tab = tab;
    for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
    const ImGuiWindow& page = pageWindow();
    const int axis = 0;
    const ImGuiID field = ImHashStr(name, 0, ImHashStr("page", 0, page.ID));
    const ImGuiID id = ImHashStr("", 0, ImHashData(&axis, sizeof axis, field));
    ImVec2 place(page.Pos.x + 20, page.Pos.y);
    while (place.y < Interface::kHeight && interface.hovered(state, place) != id) place.y += 4;
    for (const bool pressed : {true, false, true, false}) (void)interface.hovered(state, place, pressed);
    REQUIRE(interface.active() == id);
    for (const char* key = text; *key; ++key) {
      ImGui::GetIO().AddInputCharacter(static_cast<unsigned>(*key));
      (void)interface.hovered(state, place);
    }
    for (const bool pressed : {false, true, false}) (void)interface.hovered(state, {600, 500}, pressed);
  };
  type(Tab::view, "##low", "-7.5");
  CHECK(state.display.box == CropBox{{-7.5f, -1, -1}, {1, 1, 1}});
  type(Tab::view, "##low", "1e99");
  CHECK(state.display.box == CropBox{{-7.5f, -1, -1}, {1, 1, 1}});
  type(Tab::view, "##low", "5");
  CHECK(state.display.box == CropBox{{1, -1, -1}, {1, 1, 1}});
  type(Tab::view, "##high", "-5");
  CHECK(state.display.box == CropBox{{1, -1, -1}, {1, 1, 1}});
  type(Tab::view, "##high", "1e99");
  CHECK(state.display.box == CropBox{{1, -1, -1}, {1, 1, 1}});
  type(Tab::edit, "##by", "-1e99");
  CHECK(state.edit.move == glm::dvec3(0.5, 0, 0));
  type(Tab::edit, "##by", "2.5");
  CHECK(state.edit.move == glm::dvec3(2.5, 0, 0));
}

TEST_CASE("a double click on a bookmark opens a field for its name, and the new one is one step") {
  ViewerState state = bareState();
  state.ui.tab = Tab::camera;
  for (int i = 0; i < 3; ++i) addBookmark(state);
  const Interface interface;
  const auto frame = [&](ImVec2 at, bool pressed) {
    const ImGuiID over = interface.hovered(state, at, pressed);
    recordChanges(state, pressed || ImGui::IsAnyItemActive(), false);
    return over;
  };
  for (int i = 0; i < 3; ++i) frame({-1, -1}, false);
  const ImGuiWindow& page = pageWindow();
  // The row above the last one, from below.
  ImVec2 place(page.Pos.x + 30, Interface::kHeight - 5);
  ImGuiID last = 0;
  for (ImGuiID over = 0; over == 0 || over == last; place.y -= 3) {
    REQUIRE(place.y > page.Pos.y);
    over = frame(place, false);
    if (last == 0) last = over;
  }
  for (const bool pressed : {true, false}) frame(place, pressed);
  CHECK(state.camera.bookmark == 1);
  CHECK_FALSE(ImGui::GetIO().WantTextInput);
  const std::size_t steps = state.history.steps.size();
  for (const bool pressed : {true, false, false, false}) frame(place, pressed);
  CHECK(ImGui::GetIO().WantTextInput);
  for (const char* key = " from above"; *key; ++key) {
    ImGui::GetIO().AddInputCharacter(static_cast<unsigned>(*key));
    frame({-1, -1}, false);
  }
  for (const bool pressed : {false, true, false, false}) frame({600, 500}, pressed);
  CHECK_FALSE(ImGui::GetIO().WantTextInput);
  CHECK(state.camera.bookmarks[1].name == " from above");  // all of the old one was marked
  CHECK(state.history.steps.size() == steps + 1);
  CHECK(undoName(state) == "Change bookmark");
  undo(state);
  CHECK(state.camera.bookmarks[1].name == "view 2");
  for (const bool pressed : {false, true, false}) frame(place, pressed);
  CHECK_FALSE(ImGui::GetIO().WantTextInput);  // a row again

  frame({600, 500}, false);
  for (const bool pressed : {true, false, true, false, false, false}) frame(place, pressed);
  REQUIRE(ImGui::GetIO().WantTextInput);
  state.ui.tab = Tab::view;  // as another model's file, dropped, does
  for (int i = 0; i < 3; ++i) frame({600, 500}, false);
  state.ui.tab = Tab::camera;
  for (int i = 0; i < 3; ++i) frame({600, 500}, false);
  state.camera.bookmark = -1;
  for (const bool pressed : {false, true, false}) frame(place, pressed);
  CHECK(state.camera.bookmark == 1);  // nobody is in the field: a row
}

TEST_CASE("the menu of a hidden panel comes to the upper half of its line, but to no drag, and stays over all of it") {
  ViewerState state = fullState();
  state.ui.panel = false;
  const Interface interface;
  for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
  const float line = ImGui::GetFrameHeight();
  const auto menuAt = [&](float y, bool pressed = false) {
    (void)interface.hovered(state, {450, y}, pressed);
    return state.ui.menu;
  };
  CHECK_FALSE(menuAt(line - 1));
  CHECK_FALSE(menuAt(line / 2 - 1, true));
  CHECK_FALSE(menuAt(line + 1));
  CHECK(menuAt(line / 2 - 1));
  CHECK(menuAt(line - 1));
  CHECK_FALSE(menuAt(line + 1));
}

TEST_CASE("another page begins at its top, however far the one before was scrolled") {
  ViewerState state = fullState();
  const Interface interface;
  for (const float height : {760.0f, 400.0f}) {
    INFO(height);
    ImGui::GetIO().DisplaySize.y = height;
    state.ui.tab = Tab::view;
    for (int i = 0; i < 4; ++i) (void)interface.hovered(state, {-1, -1});
    ImGuiWindow* page = ImGui::FindWindowByName(pageWindow().Name);
    REQUIRE(page->ScrollMax.y > 0);
    ImGui::SetScrollY(page, page->ScrollMax.y);
    for (int i = 0; i < 2; ++i) (void)interface.hovered(state, {-1, -1});
    const float scrolled = page->Scroll.y;
    CHECK(scrolled > 0);
    state.ui.tab = Tab::inspect;
    for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
    CHECK(page->Scroll.y < scrolled);
    if (height > 500) CHECK(page->Scroll.y == 0);
  }
}

TEST_CASE("a dialog that says why a file could not be written keeps its buttons inside") {
  const TemporaryFolder folder;
  ViewerState state = bareState();
  FileDialog& dialog = state.desktop.dialog.emplace();
  dialog.use = FileUse::saveModel;
  dialog.browser.saves = true;
  dialog.browser.types = {{".tgz", ""}, {".ply", ""}};
  enterFolder(dialog.browser, folder.path);
  const Interface interface;
  float content = 0;
  for (const std::string& problem : {std::string(), "/a/" + std::string(150, 'x') + "/b.tgz: cannot write"}) {
    dialog.problem = problem;
    for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
    const ImGuiWindow* window = ImGui::FindWindowByName("file dialog");
    REQUIRE(window);
    CHECK(window->ContentSize.y <= window->Size.y - 2 * window->WindowPadding.y + 1);
    if (problem.empty()) content = window->ContentSize.y;
    CHECK(window->ContentSize.y == Approx(content).margin(1));  // the list gives the room
  }
}

TEST_CASE("of the backgrounds one button is lit, the model's own where that is black, too") {
  const auto lit = [](glm::vec3 background) {
    ViewerState state = bareState();
    state.scene.background = state.display.settings.background = background;
    const Interface interface;
    for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
    const ImU32 accent = ImGui::GetColorU32(kAccent);
    return std::ranges::count(pageWindow().DrawList->VtxBuffer, accent, &ImDrawVert::col);
  };
  CHECK(lit(glm::vec3(0.5f)) > 0);
  CHECK(lit(glm::vec3(0.0f)) == lit(glm::vec3(0.5f)));
  CHECK(lit(glm::vec3(1.0f)) == lit(glm::vec3(0.5f)));
}

TEST_CASE("the size of a recording is taken when its fields are left, and refused where no picture has it") {
  ViewerState state = bareState();
  state.ui.tab = Tab::path;
  const Interface interface;
  for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
  const ImGuiID group = ImHashStr("##size", 0, ImHashStr("page", 0, pageWindow().ID));
  const auto field = [group](int component) {
    return ImHashStr("", 0, ImHashData(&component, sizeof component, group));
  };
  ImVec2 place(40, 2);
  while (place.y < Interface::kHeight && interface.hovered(state, place) != field(0)) place.y += 4;
  const auto type = [&](std::string_view digits) {
    const glm::ivec2 before = state.record.size;
    for (const char digit : digits) {
      ImGui::GetIO().AddInputCharacter(static_cast<unsigned>(digit));
      (void)interface.hovered(state, place);
      CHECK(state.record.size == before);
    }
  };
  const auto enter = [&] {
    for (const bool pressed : {true, false}) (void)interface.hovered(state, place, pressed);
    CHECK(interface.active() == field(0));
  };
  const auto leave = [&] {
    for (const bool pressed : {false, true, false}) (void)interface.hovered(state, {600, 500}, pressed);
    return state.record.size;
  };
  const auto typed = [&](std::string_view digits) {
    enter();
    type(digits);
    return leave();
  };
  CHECK(typed("1920") == glm::ivec2(1920, 720));
  CHECK(typed("16384") == glm::ivec2(kMaxImageSide, 720));
  CHECK(state.messages.notice.empty());
  // Words of a refused one with what was typed.
  for (const char* digits : {"16385", "99999", "0", "-5", "4294967297"}) {
    INFO(digits);
    state.messages.notice.clear();
    CHECK(typed(digits) == glm::ivec2(kMaxImageSide, 720));
    CHECK_THAT(state.messages.notice, Contains(imageSizeLimits()) && Contains("x720"));
  }
  CHECK_THAT((typed("99999"), state.messages.notice), Contains("found 99999x720"));
  state.messages.notice.clear();
  // Tab leads to the other side and back, and to no other widget.
  const auto tab = [&] {
    interface.press(state, ImGuiKey_Tab);
    return interface.active();
  };
  enter();
  type("100");
  CHECK(tab() == field(1));
  type("200");
  CHECK(leave() == glm::ivec2(100, 200));
  enter();
  type("300");
  CHECK(tab() == field(1));
  CHECK(state.record.size == glm::ivec2(100, 200));  // not yet
  CHECK(leave() == glm::ivec2(300, 200));            // also where nothing is typed there
  enter();
  CHECK(tab() == field(1));
  CHECK(tab() == field(0));
  CHECK(leave() == glm::ivec2(300, 200));
  CHECK(tab() == 0);
  CHECK(state.messages.notice.empty());
  state.record.size = {4096, kMaxImageSide};  // the width alone is too much
  enter();
  type("16384");
  CHECK(tab() == field(1));
  type("4096");
  CHECK(leave() == glm::ivec2(kMaxImageSide, 4096));
  CHECK(state.messages.notice.empty());
  // No number is taken by its first digits.
  for (const char* text : {"1.5", "1920*2", "+5", "--5"}) {
    CHECK(typed(text) == glm::ivec2(kMaxImageSide, 4096));
    CHECK_THAT(std::exchange(state.messages.notice, ""), Contains("found " + std::string(text) + "x4096"));
  }
  enter();
  interface.press(state, ImGuiKey_Backspace);
  CHECK(leave() == glm::ivec2(kMaxImageSide, 4096));
  CHECK_THAT(std::exchange(state.messages.notice, ""), Contains("found x4096"));
  state.record.size = {1, kMaxImageSide};
  CHECK(typed("16000") == glm::ivec2(1, kMaxImageSide));
  CHECK_THAT(state.messages.notice, Contains(imageSizeLimits()));
}

TEST_CASE("the panel says that a run has ended which it was told to stop") {
  ViewerState state = fullState();
  state.scene.training = "plain 300 / 7000";
  const Interface interface;
  CHECK_THAT(interface.text(state), !Contains("the run has stopped"));
  state.follow.told = RunCommand::stop;
  CHECK_THAT(interface.text(state), Contains("the run has stopped"));
}

TEST_CASE("the list of open models marks those with edits that were not saved") {
  ViewerState state = fullState();
  const Interface interface;
  CHECK_THAT(interface.text(state), !Contains("tgz*"));
  state.documents.open[1].edit.revision = newRevision();
  CHECK_THAT(interface.text(state), Contains("other.tgz*") && !Contains("tiny.tgz*"));
}

TEST_CASE("in a panel of the usual width it is said whole why there is nothing to compare with") {
  ViewerState state = fullState();
  state.compare.how.mode = CompareMode::wipe;
  const Interface interface;
  for (const char* problem : {"No photograph was taken from here", "There is nothing to compare with"}) {
    state.compare.problem = problem;
    state.compare.way_out = "Go to a camera of the model (Space, or . and ,)";
    CHECK_THAT(interface.text(state), Contains(problem));
  }
}

TEST_CASE("camera list, up axes, turntable, lines of the path and its Clear have hints") {
  for (const auto& [tab, name] : {std::pair(Tab::camera, "##camera"),
                                  {Tab::camera, "+x"},
                                  {Tab::camera, "##turn"},
                                  {Tab::path, "Lines in the scene"},
                                  {Tab::path, "Clear"}}) {
    INFO(name);
    ViewerState state = fullState();
    state.ui.tab = tab;
    const Interface interface;
    for (int i = 0; i < 3; ++i) (void)interface.hovered(state, {-1, -1});
    const ImGuiID id = ImHashStr(name, 0, ImHashStr("page", 0, pageWindow().ID));
    bool found = false;
    for (float y = 2; y < Interface::kHeight && !found; y += 6) {
      for (float x = 20; x < panelWidth(state, Interface::kWidth) && !found; x += 20) {
        found = interface.hovered(state, {x, y}) == id;
        if (!found) continue;
        for (int i = 0; i < 60; ++i) (void)interface.hovered(state, {x, y});
        const ImGuiWindow* hint = ImGui::FindWindowByName("##Tooltip_00");
        CHECK((hint && hint->Active));
      }
    }
    CHECK(found);
  }
}
