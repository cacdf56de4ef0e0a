// SPDX-License-Identifier: Apache-2.0
#include <QApplication>
#include <QCommandLineParser>
#include <QScreen>
#include <QSettings>
#include <QStandardPaths>
#include <QTimer>
#include <QTranslator>
#include <csignal>

#include "gui/window/flat_memory.h"
#include "gui/window/main_window.h"
#include "gui/window/style.h"
#include "helicarm/core/program_version.h"

/// " (5da20f9512)", or empty; written at each build by cmake/commit.cmake.
extern const char* const commit_in_brackets;

namespace {
volatile std::sig_atomic_t told_to_end = 0;
}

int main(int argc, char** argv) {
  using namespace helicarm::gui;
  helicarm::program_commit() = commit_in_brackets;
  keep_memory_flat();
  QApplication app(argc, argv);
  QApplication::setOrganizationName("helicarm");
  QApplication::setApplicationName("helicarm-gui");
  QApplication::setApplicationVersion(HELICARM_VERSION);
  const QSettings kept;
  constexpr int large_screen = 1000, large_text_px = 16;
  const bool is_large = QApplication::primaryScreen()->size().height() >= large_screen;
  style::apply({kept.value("appearance/light").toBool() ? style::Theme::light : style::Theme::dark,
                kept.value("appearance/text_px", is_large ? large_text_px : style::usual_text_px).toInt()});
  QTranslator language;
  if (language.load(QLocale(), "helicarm", "_",
                    QApplication::applicationDirPath() + "/../share/helicarm/translations"))
    QApplication::installTranslator(&language);

  QCommandLineParser words;
  words.setApplicationDescription(
      "The desktop application of helicarm. Without arguments it starts virtual devices, so that a whole "
      "operation can be rehearsed without hardware. Research instrument, not a medical device.");
  words.addHelpOption();
  words.addVersionOption();
  const QCommandLineOption plan("plan", "Connect the devices of this plan instead (docs/formats.md).",
                                "FILE");
  const QCommandLineOption sessions("sessions", "Folder for the records of operations.", "DIR");
  words.addOptions({plan, sessions});
  words.addPositionalArgument("paths", "A case folder, a session folder, or X-ray images to open.",
                              "[PATH...]");
  if (!words.parse(QApplication::arguments())) {
    std::fprintf(stderr, "%s\n", qPrintable(words.errorText()));
    return 2;
  }
  words.process(app);  // --help and --version

  const QString place =
      words.isSet(sessions)
          ? words.value(sessions)
          : QStandardPaths::writableLocation(QStandardPaths::AppLocalDataLocation) + "/sessions";
  MainWindow window(place.toStdString());
  const QSize available = QApplication::primaryScreen()->availableSize();
  constexpr int frame_px = 40;  // of the window manager, above and below
  window.resize(is_large ? 0.9 * available : QSize(1280, 800).boundedTo(available - QSize(0, frame_px)));
  window.restore_layout();
  window.show();
  std::vector<std::filesystem::path> paths;
  for (const QString& path : words.positionalArguments()) paths.push_back(path.toStdString());
  if (!paths.empty())
    window.open_paths(paths);
  else if (words.isSet(plan))
    window.open_plan(words.value(plan).toStdString());
  else if (!kept.value("tour/offered").toBool())
    window.start_tour();  // at the first start
  else
    window.open_rehearsal({});
  QSettings().setValue("tour/offered", true);
  for (const int signal : {SIGTERM, SIGINT}) std::signal(signal, [](int) { told_to_end = 1; });
  QTimer listener;
  QObject::connect(&listener, &QTimer::timeout, [] {
    if (told_to_end) QApplication::exit();  // quit() would ask
  });
  constexpr int glance_ms = 50;
  listener.start(glance_ms);
  const int code = QApplication::exec();
  window.keep_layout();
  return code;
}
