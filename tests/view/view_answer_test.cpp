// SPDX-License-Identifier: Apache-2.0
#include "locusctl/view/view_answer.hpp"

#include <gtest/gtest.h>

#include <string>
#include <string_view>

#include <fmt/format.h>

#include "daemon/http_server.hpp"

namespace locus::tools {
namespace {

const LiveView& some_view() {
  static const LiveView view(1);
  return view;
}

std::string answer(std::string_view request) { return view_answer(request, "<p>page", some_view()); }

std::string get(std::string_view target, std::string_view host = "127.0.0.1:8042") {
  return answer(fmt::format("GET {} HTTP/1.1\r\nHost: {}\r\n\r\n", target, host));
}

std::string status_of(const std::string& answer) { return answer.substr(9, 3); }

TEST(ViewAnswer, PageAndDataAreServed) {
  EXPECT_TRUE(get("/").ends_with("\r\n\r\n<p>page"));
  EXPECT_EQ(status_of(get("/")), "200");
  const std::string live = get("/live?epoch=1&tiles=2&positions=3&sequence=4");
  EXPECT_EQ(status_of(live), "200");
  EXPECT_NE(live.find("\"epoch\":1"), std::string::npos);
}

TEST(ViewAnswer, OnlyNamesOfTheLoopbackInterfaceAreAccepted) {
  for (const char* host : {"127.0.0.1", "127.0.0.1:9000", "localhost:8042", "LocalHost", "[::1]:8042", "[::1]"})
    EXPECT_EQ(status_of(get("/live", host)), "200") << host;
  for (const char* host : {"", "evil.example", "evil.example:8042", "127.0.0.1.evil.example", "localhost.evil.example",
                           "10.0.0.1:8042", "robot", "::1", "127.0.0.1:80:80"})
    EXPECT_EQ(status_of(get("/live", host)), "403") << host;
  EXPECT_EQ(status_of(answer("GET / HTTP/1.1\r\n\r\n")), "403") << "no host";
  EXPECT_EQ(status_of(answer("GET / HTTP/1.1\r\nHost: localhost\r\nHost: evil.example\r\n\r\n")), "403") << "two";
}

TEST(ViewAnswer, MethodsOtherThanGetAreRejected) {
  for (const char* method : {"POST", "HEAD", "PUT", "DELETE", "OPTIONS", "get"})
    EXPECT_EQ(status_of(answer(fmt::format("{} / HTTP/1.1\r\nHost: localhost\r\n\r\n", method))), "405") << method;
}

TEST(ViewAnswer, OtherResourcesDoNotExist) {
  for (const char* target : {"/x", "/live/", "//", "/../etc/passwd", "http://127.0.0.1/", "*"})
    EXPECT_EQ(status_of(get(target)), "404") << target;
}

TEST(ViewAnswer, GarbageIsABadRequest) {
  for (const std::string& request :
       {std::string{}, std::string{"\r\n\r\n"}, std::string(9, '\0') + "\xff\xfe \r\n\r\n",
        std::string(daemon::HttpServer::kMaxRequestBytes + 1, 'A'),
        std::string{"GET / HTTP/1.1\r\nHost: localhost\r\n"}, std::string{"GET / HTTP/2\r\nHost: localhost\r\n\r\n"},
        std::string{"GET /\r\nHost: localhost\r\n\r\n"}})
    EXPECT_EQ(status_of(answer(request)), "400") << request.substr(0, 40);
}

TEST(ViewAnswer, MalformedQueriesCountAsNothingKnown) {
  for (const char* query : {"", "?", "?&&", "?epoch", "?epoch=", "?epoch=x", "?tiles=-1&epoch=1", "?epoch=1e3",
                            "?epoch=99999999999999999999999", "?sequence=1&sequence=2", "?=&="})
    EXPECT_EQ(status_of(get(std::string{"/live"} + query)), "200") << query;
}

TEST(ViewAnswer, EveryAnswerHasTheSecurityFields) {
  for (const std::string& one : {get("/"), get("/live"), get("/x"), get("/", "evil.example"), answer("?"),
                                 answer("POST / HTTP/1.1\r\nHost: localhost\r\n\r\n")})
    for (const char* field : {"Content-Security-Policy: default-src 'none';", "frame-ancestors 'none'",
                              "Cross-Origin-Resource-Policy: same-origin", "X-Content-Type-Options: nosniff"})
      EXPECT_NE(one.find(field), std::string::npos) << field << '\n' << one.substr(0, 300);
}

} // namespace
} // namespace locus::tools
