// SPDX-License-Identifier: Apache-2.0
#include <chrono>
#include <fstream>
#include <iostream>
#include <memory>
#include <optional>
#include <random>
#include <thread>

#include "common.hpp"
#include "progress.hpp"
#include "view/page.hpp"
#include "view/view_report.hpp"
#include "view/view_server.hpp"

namespace revisit::cli {
namespace {

namespace fs = std::filesystem;

constexpr int kUsualPort = 8137;

struct ViewOptions {
  std::string results, other, report, host = "127.0.0.1";
  int port = kUsualPort;
  double report_mb = 8.0;
};

bool is_loopback(const std::string& host) { return host == "127.0.0.1" || host == "localhost" || host == "::1"; }

std::string random_token() {
  std::random_device random;
  std::string token;
  constexpr const char* kDigits = "0123456789abcdef";
  for (int i = 0; i < 32; ++i) token += kDigits[random() % 16];
  return token;
}

int write_report(ResultsView& view, const ViewOptions& options) {
  const auto page = view_report(view, static_cast<std::size_t>(options.report_mb * 1e6));
  if (!page) return fail(page.error());
  std::ofstream stream(options.report, std::ios::binary | std::ios::trunc);
  stream << *page;
  stream.close();
  if (!stream) return fail({options.report + ": cannot be written"});
  std::cout << options.report << ": " << (page->size() + 500'000) / 1'000'000 << " MB, opens in any browser\n";
  return kDone;
}

Result<std::unique_ptr<ViewServer>> serve(std::vector<std::shared_ptr<ResultsView>> views, const ViewOptions& options) {
  ServerOptions how{.host = options.host, .port = options.port, .token = {}};
  if (!is_loopback(options.host)) how.token = random_token();
  auto server = ViewServer::start(views, how);
  if (server || options.port != kUsualPort) return server;
  how.port = 0;  // somebody else has the usual one
  return ViewServer::start(std::move(views), how);
}

// Of a map alone.
Status make_tiles(ResultsView& view) {
  listen_for_interrupt();
  std::optional<Progress> progress;
  const Status status = view.make_tiles([&](std::size_t done, std::size_t all) {
    if (!progress) progress.emplace("points", "key frames", all);
    progress->update(done);
    return !interrupted();
  });
  return interrupted() ? Status(Error{"interrupted"}) : status;
}

int view(const ViewOptions& options) {
  if (const Status status = check_output(options.report.empty() ? "report.html" : options.report, ".html"); !status)
    return fail(status.error(), kUsage);
  if (!options.report.empty() && !options.other.empty())
    return fail({"--report holds one result; leave out --compare"}, kUsage);
  std::vector<std::shared_ptr<ResultsView>> views;
  for (const std::string& path : {options.results, options.other}) {
    if (path.empty()) continue;
    auto opened = ResultsView::open(path);
    if (!opened) return fail(opened.error());
    if ((*opened)->has_map() && !(*opened)->has_tiles())
      if (const Status made = make_tiles(**opened); !made)
        return fail(made.error(), interrupted() ? kInterrupted : kFailed);
    if (const auto json = (*opened)->json(); !json) return fail(json.error());  // before a page shows nothing
    if (!is_loopback(options.host)) (*opened)->forbid_recording();
    views.push_back(*std::move(opened));
  }
  if (page_html().empty())
    return fail({"this program was built without the page; build it with `make`, which needs npm"});
  if (!options.report.empty()) return write_report(*views.front(), options);
  const auto server = serve(std::move(views), options);
  if (!server) return fail(server.error());
  listen_for_interrupt();
  std::cout << "Open " << (*server)->address() << " in a browser. Ctrl-C ends." << std::endl;
  while (!interrupted()) std::this_thread::sleep_for(std::chrono::milliseconds(100));
  return kDone;
}

}  // namespace

Run add_view(CLI::App& program) {
  auto options = std::make_shared<ViewOptions>();
  CLI::App* command =
      program.add_subcommand("view", "Look at a map, its loops and why they were believed, in a browser.");
  command->footer(
      "Shows the points, the trajectory before and after closing loops, each loop with both scans laid on each other,\n"
      "refused candidates with the reason, charts, and the drive in time. With a reference (`revisit evaluate` leaves "
      "it\n"
      "in the folder) false loops stand out.\n\n"
      "Example: revisit view maps/00\n"
      "         revisit view maps/00 --compare maps/00_without_intensity\n"
      "         revisit view maps/00 --report 00.html");
  command->add_option("results", options->results, "Folder that `revisit slam` or `detect` wrote, or a map")
      ->required();
  command->add_option("--compare", options->other, "Another one, side by side");
  command->add_option("--report", options->report, "Writes the page as one file instead, .html, to send to somebody");
  command
      ->add_option("--report-mb", options->report_mb,
                   "Points in that file, at most, MB: the coarsest of the map, and the scans of loops")
      ->check(CLI::Range(0.0, 500.0));
  command->add_option("--host", options->host,
                      "Where to listen; for others than this machine a token is made, which the address then has");
  command->add_option("--port", options->port, "0: any that is free")->check(CLI::Range(0, 65535));
  return [options] { return view(*options); };
}

}  // namespace revisit::cli
