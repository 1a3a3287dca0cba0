// SPDX-License-Identifier: Apache-2.0
#include "view/view_server.hpp"

#include <atomic>
#include <charconv>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string_view>
#include <thread>
#include <utility>

#include <httplib.h>
#include <nlohmann/json.hpp>

#include "view/page.hpp"
#include "view/view_files.hpp"

namespace revisit::cli {
namespace {

// With these parameters httplib takes them as they are: what it thinks can be compressed, it compresses with brotli at
// its highest level, which takes seconds for the view of a large map.
constexpr const char *kScript = "application/javascript; charset=utf-8", *kJson = "application/json; charset=utf-8";

namespace fs = std::filesystem;
using httplib::Request;
using httplib::Response;

constexpr const char* kPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self' blob: data:; img-src 'self' blob: "
    "data:; worker-src 'self' blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

void refuse(Response& response, int status, const std::string& why) {
  response.status = status;
  response.set_content(why + "\n", "text/plain; charset=utf-8");
}

bool is_same(const std::string& a, const std::string& b) {  // in the same time, whatever they are
  if (a.size() != b.size()) return false;
  unsigned differs = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    differs |= static_cast<unsigned char>(a[i]) ^ static_cast<unsigned char>(b[i]);
  return differs == 0;
}

// The host of "host:port" or "[host]:port".
std::string host_of(const std::string& authority) {
  if (authority.starts_with('[')) return authority.substr(1, authority.find(']') - 1);
  return authority.substr(0, authority.find(':'));
}

// A page of another origin must not read this one through a name that it has pointed here.
bool is_host_alright(const Request& request, const ServerOptions& options) {
  const std::string host = host_of(request.get_header_value("Host"));
  return host == "127.0.0.1" || host == "localhost" || host == "::1" || host == options.host || !options.token.empty();
}

bool has_token(const Request& request, const std::string& token) {
  if (token.empty()) return true;
  if (request.has_param("token") && is_same(request.get_param_value("token"), token)) return true;
  const std::string cookies = request.get_header_value("Cookie"), name = "revisit_token=";
  const std::size_t at = cookies.find(name);
  return at != std::string::npos && is_same(cookies.substr(at + name.size(), token.size()), token);
}

std::optional<FrameId> frame_in(const std::string& text) {
  std::int64_t value = 0;
  const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), value);
  return problem == std::errc() && end == text.data() + text.size() ? std::optional(FrameId{value}) : std::nullopt;
}

// What changes while a map is made.
std::string state_of(const ResultsView& view) {
  std::string state;
  for (const fs::path& file : {view.folder() / "candidates.csv", view.tiles() / "tileset.json", view.map_file(),
                               fs::path(view.map_file().string() + "-wal")}) {
    std::error_code failure;
    const auto when = fs::last_write_time(file, failure);
    state += failure ? "-" : std::to_string(when.time_since_epoch().count());
  }
  return state;
}

}  // namespace

class ViewServer::Implementation {
 public:
  Implementation(std::vector<std::shared_ptr<ResultsView>> views, const ServerOptions& options)
      : views_(std::move(views)), options_(options) {
    server_.new_task_queue = [] { return new httplib::ThreadPool(kThreads); };
    server_.set_socket_options([](socket_t socket) {  // without SO_REUSEPORT: a port has one server
      const int yes = 1;
      setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    });
    server_.set_read_timeout(kTimeout_s);
    server_.set_write_timeout(kTimeout_s);
    server_.set_keep_alive_timeout(kTimeout_s);
    server_.set_payload_max_length(1);  // nothing is sent here
    server_.set_pre_routing_handler(
        [this](const Request& request, Response& response) { return admit(request, response); });
    serve("/", "text/html; charset=utf-8", page_html());
    serve("/viewer.js", kScript, page_script());
    serve("/viewer.css", "text/css; charset=utf-8", page_style());
    server_.Get("/views.json", [this](const Request&, Response& response) {
      response.set_content(nlohmann::json({{"views", views_.size()}}).dump(), kJson);
    });
    server_.Get(R"(/([ab])/view\.json)", [this](const Request& request, Response& response) {
      if (auto* view = view_of(request, response)) send(response, view->json(), kJson);
    });
    server_.Get(R"(/([ab])/tiles/(tileset\.json|\d+_\d+_\d+_\d+\.glb))",
                [this](const Request& request, Response& response) {
                  auto* view = view_of(request, response);
                  if (view == nullptr) return;
                  const std::string name = request.matches[2];
                  auto bytes = read_tile(view->tiles(), name);
                  if (!bytes) return refuse(response, 404, name + ": not there");
                  response.set_content(*std::move(bytes), name.ends_with(".glb") ? "model/gltf-binary" : kJson);
                });
    server_.Get(R"(/([ab])/scans/(\d{1,18})\.bin)", [this](const Request& request, Response& response) {
      auto* view = view_of(request, response);
      const auto frame = frame_in(request.matches[2]);
      if (view == nullptr || !frame) return;
      const auto points = view->points(*frame);
      if (!points) return refuse(response, 404, points.error().message);
      response.set_content(bytes_of_points(*points), "application/octet-stream");
    });
    server_.Get(R"(/([ab])/descriptors/(\d{1,18})\.json)", [this](const Request& request, Response& response) {
      auto* view = view_of(request, response);
      const auto frame = frame_in(request.matches[2]);
      if (view == nullptr || !frame) return;
      const auto descriptor = view->descriptor(*frame);
      if (!descriptor) return refuse(response, 404, descriptor.error().message);
      if (!*descriptor)
        return refuse(response, 404, "the place was known already: its descriptor is that of another key frame");
      response.set_content(to_json(**descriptor), kJson);
    });
    server_.Get("/events", [this](const Request&, Response& response) { tell_changes(response); });
  }

  ~Implementation() {
    is_ending_ = true;
    server_.stop();
    if (thread_.joinable()) thread_.join();
  }

  Result<int> listen() {
    const int port = options_.port == 0                                   ? server_.bind_to_any_port(options_.host)
                     : server_.bind_to_port(options_.host, options_.port) ? options_.port
                                                                          : -1;
    if (port <= 0)
      return Error{"cannot listen at " + options_.host + ":" + std::to_string(options_.port) +
                   "; name another port with --port, or 0 for any that is free"};
    thread_ = std::thread([this] { server_.listen_after_bind(); });
    while (!server_.is_running()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return port;
  }

 private:
  static constexpr std::size_t kThreads = 48;
  static constexpr int kMostListeners = 16;
  static constexpr std::time_t kTimeout_s = 5;

  httplib::Server::HandlerResponse admit(const Request& request, Response& response) {
    using Routing = httplib::Server::HandlerResponse;
    for (const auto& [name, value] : {std::pair{"Content-Security-Policy", kPolicy},
                                      {"X-Content-Type-Options", "nosniff"},
                                      {"Referrer-Policy", "no-referrer"},
                                      {"Cross-Origin-Resource-Policy", "same-origin"},
                                      {"Cache-Control", "no-store"}})
      response.set_header(name, value);
    if (request.method != "GET" && request.method != "HEAD") {
      refuse(response, 405, "this server only reads: GET");
    } else if (!is_host_alright(request, options_)) {
      refuse(response, 403, "asked for under another name than 127.0.0.1 or localhost");
    } else if (!has_token(request, options_.token)) {
      refuse(response, 403, "the address with its token is needed, as `revisit view` printed it");
    } else {
      if (request.has_param("token"))
        response.set_header("Set-Cookie", "revisit_token=" + options_.token + "; HttpOnly; SameSite=Strict; Path=/");
      return Routing::Unhandled;
    }
    return Routing::Handled;
  }

  void serve(const char* path, const char* type, std::string_view text) {
    server_.Get(path, [type, text](const Request&, Response& response) {
      response.set_content(text.data(), text.size(), type);
    });
  }

  ResultsView* view_of(const Request& request, Response& response) {
    const auto index = static_cast<std::size_t>(request.matches[1].str()[0] - 'a');
    if (index < views_.size()) return views_[index].get();
    refuse(response, 404, "there is one view only");
    return nullptr;
  }

  static void send(Response& response, Result<std::string> text, const char* type) {
    if (!text) return refuse(response, 500, text.error().message);
    response.set_content(*std::move(text), type);
  }

  std::string state_of_all() const {
    std::string state;
    for (const auto& view : views_) state += state_of(*view);
    return state;
  }

  // Server-sent events: a message when the files have changed, at most one a second.
  void tell_changes(Response& response) {
    if (++listeners_ > kMostListeners) {
      --listeners_;
      return refuse(response, 503, "too many pages listen");
    }
    response.set_chunked_content_provider(
        "text/event-stream",
        [this, last = state_of_all()](std::size_t, httplib::DataSink& sink) mutable {
          constexpr auto kStep = std::chrono::milliseconds(100);
          for (int i = 0; i < 10 && !is_ending_; ++i) std::this_thread::sleep_for(kStep);
          const std::string now = state_of_all();
          const std::string text = now == last ? ": nothing new\n\n" : "data: changed\n\n";
          last = now;
          return !is_ending_ && sink.write(text.data(), text.size());
        },
        [this](bool) { --listeners_; });
  }

  std::vector<std::shared_ptr<ResultsView>> views_;
  ServerOptions options_;
  httplib::Server server_;
  std::thread thread_;
  std::atomic<bool> is_ending_ = false;
  std::atomic<int> listeners_ = 0;
};

Result<std::unique_ptr<ViewServer>> ViewServer::start(std::vector<std::shared_ptr<ResultsView>> views,
                                                      const ServerOptions& options) {
  std::unique_ptr<ViewServer> server(new ViewServer);
  server->implementation_ = std::make_unique<Implementation>(std::move(views), options);
  const auto port = server->implementation_->listen();
  if (!port) return port.error();
  const bool is_ipv6 = options.host.find(':') != std::string::npos;
  server->address_ = "http://" + (is_ipv6 ? "[" + options.host + "]" : options.host) + ":" + std::to_string(*port) +
                     "/" + (options.token.empty() ? "" : "?token=" + options.token);
  return server;
}

ViewServer::~ViewServer() = default;

}  // namespace revisit::cli
