#include "clients/cli/take_pictures.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <memory>
#include <utility>

#include "clients/cli/browser.h"
#include "clients/cli/page_server.h"

namespace adhesim {
namespace {

constexpr double kBrowserTimeoutS = 60;

// What the page complained of, behind what went wrong.
absl::Status WithComplaints(const absl::Status& status, const Browser& browser) {
  if (browser.page_errors().empty()) return status;
  return absl::Status(status.code(), absl::StrCat(status.message(), "; the page says: ",
                                                  absl::StrJoin(browser.page_errors(), "; ")));
}

absl::Status OpenPage(const PictureOptions& options, const std::string& url, Browser* browser) {
  const absl::Status opened = browser->Open(
      absl::StrCat(url, "&picture=1&colour=", options.colour_map, "&theme=", options.theme,
                   "&hide=", absl::StrJoin(options.hide, ",")));
  if (!opened.ok()) return opened;
  return browser
      ->Evaluate(R"(new Promise((done, fail) => {
        const look = () => {
          const page = window.adhesim;
          const banner = document.querySelector('#banner[data-level="error"]:not([hidden])');
          if (banner) fail(new Error(banner.textContent));
          else if (page?.errors?.length) fail(new Error(page.errors.join('; ')));
          else if (page?.mode === 'recording') done(true);
          else setTimeout(look, 20);
        };
        look();
      }))")
      .status();
}

// Shows an instant and takes the page as it is painted then.
absl::StatusOr<Picture> TakePicture(double at_s, Browser* browser) {
  const absl::StatusOr<nlohmann::json> shown =
      browser->Evaluate(absl::StrFormat("window.adhesim.showAt(%.9f)", at_s));
  if (!shown.ok()) return shown.status();
  absl::StatusOr<std::string> png = browser->Screenshot();
  if (!png.ok()) return png.status();
  if (!browser->page_errors().empty()) return absl::InternalError("the page has errors");
  return Picture{at_s, shown->value("timeS", 0.0), shown->value("step", std::int64_t{0}),
                 *std::move(png)};
}

}  // namespace

absl::Status CanTakePictures(const std::string& browser) {
  if (const absl::Status found = Browser::Find(browser).status(); !found.ok()) return found;
  return PageServer::HasPage();
}

absl::Status TakePictures(const std::string& recording, const std::vector<double>& at_s,
                          const PictureOptions& options,
                          const std::function<absl::Status(const Picture&)>& take) {
  const absl::StatusOr<std::unique_ptr<PageServer>> server = PageServer::Start(recording);
  if (!server.ok()) return server.status();
  Browser::Options window;
  window.program = options.browser;
  window.width = options.width;
  window.height = options.height;
  window.timeout_s = kBrowserTimeoutS;
  window.stop = options.stop;
  const absl::StatusOr<std::unique_ptr<Browser>> browser = Browser::Start(window);
  if (!browser.ok()) return browser.status();
  const absl::Status opened = OpenPage(options, (*server)->url(), browser->get());
  if (!opened.ok()) return WithComplaints(opened, **browser);
  for (const double instant_s : at_s) {
    const absl::StatusOr<Picture> picture = TakePicture(instant_s, browser->get());
    if (!picture.ok()) return WithComplaints(picture.status(), **browser);
    if (const absl::Status taken = take(*picture); !taken.ok()) return taken;
  }
  return absl::OkStatus();
}

}  // namespace adhesim
