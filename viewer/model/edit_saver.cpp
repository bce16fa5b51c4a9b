// SPDX-License-Identifier: Apache-2.0
// The saver's thread.
#include "viewer/model/edit_saver.h"

#include <new>
#include <utility>

#include "converter/registry/file_format.h"
#include "core/system/error.h"
#include "viewer/view/edits.h"

namespace tg {

EditSaver::EditSaver(std::function<void()> wake)
    : done_(Queue<Job>::kUnlimited, std::move(wake)), thread_(startWorker(done_, [this](const std::stop_token& stop) {
        while (auto job = asked_.take(stop)) {
          write(*job);
          job->model.reset();
          job->beside = {};
          done_.give(std::move(*job));
        }
      })) {}

void EditSaver::write(Job& job) {
  try {
    job.beside.model = *job.model;
    Written written;
    writeModel(outputFormat(job.file), job.file, job.beside, {}, written);
    job.warnings = std::move(written.warnings);
  } catch (const Error& error) {
    job.problem = error.what();
    job.error_kind = static_cast<int>(error.kind);
  } catch (const std::bad_alloc&) {
    job.problem = job.file.string() + ": not enough memory";
    job.error_kind = static_cast<int>(ErrorKind::cannotWrite);
  } catch (const std::exception& error) {
    job.problem = job.file.string() + ": " + error.what();
    job.error_kind = static_cast<int>(ErrorKind::cannotWrite);
  }
}

void EditSaver::update(ViewerState& state, bool scripted) {
  if (const auto file = std::exchange(state.edit.save_request, std::nullopt); file && state.scene.model) {
    Job job;
    job.document = state.scene.path;
    job.file = *file;
    job.model = state.scene.model;
    job.beside.cameras = state.scene.cameras;
    job.beside.training_json = state.scene.training_json;
    job.beside.background = state.scene.background;
    job.revision = state.edit.revision;
    job.whole = holdsModel(*file, state.scene);
    asked_.give(std::move(job));
    ++under_way_;
    if (!scripted) notify(state, "Saving " + file->string());
  }
  while (std::optional<Job> job = done_.poll()) {
    --under_way_;
    const std::optional<Question> after = std::exchange(state.after_save, std::nullopt);
    if (!job->problem.empty()) {
      if (scripted) throw Error(static_cast<ErrorKind>(job->error_kind), job->problem);
      state.messages.error = job->problem;
      state.messages.notice_until = 0;
      continue;
    }
    const int document = documentOf(state, job->document);
    if (document >= 0 && job->whole) {
      EditState& edit = document == state.documents.shown
                            ? state.edit
                            : state.documents.open[static_cast<std::size_t>(document)].edit;
      edit.saved = job->revision;
    }
    if (!scripted) {
      std::string text = "Saved " + job->file.string();
      for (const std::string& warning : job->warnings) text += "\n" + warning;
      notify(state, text);
    }
    if (!after || !job->whole) continue;
    if (after->kind == Question::Kind::quit) state.quit = true;
    if (after->kind == Question::Kind::close && document >= 0) state.documents.close_request = document;
  }
  state.edit.saving = under_way_ > 0;
}

}  // namespace tg
