// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QListWidget>
#include <QSplitter>
#include <array>

#include "gui/window/framed_xray.h"

namespace helicarm::gui {

/// Two or four large X-ray images, and thumbnails of all views where there are more of them.
class XrayPanels : public QWidget {
  Q_OBJECT

 public:
  static constexpr std::size_t most_large = 4;

  explicit XrayPanels(QWidget* parent = nullptr);

  XrayView& xray(std::size_t panel) { return panels_.at(panel)->xray(); }
  FramedXray& panel(std::size_t number) { return *panels_.at(number); }
  /// The view in a panel; nothing if it displays none.
  std::optional<std::size_t> view_in(std::size_t panel) const { return panels_.at(panel)->view(); }
  /// The panel of a view.
  std::optional<std::size_t> panel_of(std::size_t view) const;
  QListWidget& thumbnails() { return *thumbnails_; }
  /// Displayed frames that are not their views' own.
  std::vector<std::shared_ptr<const pipeline::Result>> other_frames() const;
  /// The chosen frame of a view's file, 1-based.
  int frame_of(std::size_t view) const { return frames_.at(view); }

  void show_state(const ApplicationState& state);
  /// Puts a view into the panel that was changed longest ago, unless a panel has it.
  void display(std::size_t view);
  /// Two or four.
  void set_large(std::size_t number);
  void set_layer(Layer layer);
  /// Over each image: why nothing measured is drawn, and points whose picks have changed.
  void set_out_of_date(const QString& why, const std::set<std::string>& points);

 signals:
  void picked(std::size_t view, const QPointF& raw);
  void pick_moved(std::size_t view, const QString& name, const QPointF& raw);
  void pick_menu_wanted(std::size_t view, const QString& name, const QPoint& global);
  /// Other views or frames are displayed.
  void displayed();
  void frame_changed(std::size_t view, int frame);

 private:
  void build();
  void assign();
  void fill(std::size_t panel);
  void fill_thumbnails(const ApplicationState& state);
  void mark_displayed();
  void scale_residuals();

  std::array<FramedXray*, most_large> panels_{};
  std::array<QSplitter*, 2> rows_{};
  QListWidget* thumbnails_ = nullptr;

  std::size_t large_ = 2;
  std::vector<std::string> names_;  ///< of the views
  std::vector<ViewFile> files_;     ///< of the views
  std::vector<int> frames_;
  std::vector<std::size_t> views_;  ///< by panel
  std::vector<unsigned> changed_;   ///< by panel, when
  unsigned changes_ = 0;
  std::shared_ptr<const pipeline::Result> result_;
  QString why_empty_;
  std::vector<std::shared_ptr<const xray::XrayImage>> thumbed_;
};

}  // namespace helicarm::gui
