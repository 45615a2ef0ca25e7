#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/file_lock.hpp>
#include <diracstep/files/input_file.hpp>
#include <diracstep/files/output_file.hpp>
#include <diracstep/files/paths.hpp>
#include <diracstep/files/sha256.hpp>
#include <diracstep/files/shown_text.hpp>
#include <filesystem>
#include <fstream>
#include <string>

/// Files and texts of unknown origin, and outputs that must not meet anything else.
namespace diracstep::testing {
namespace {

namespace fs = std::filesystem;

class Files : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const { return folder_.path(name); }
  void write(const std::string& name, const std::string& text) const { (void)folder_.write(name, text); }
  std::string contents(const std::string& name) const { return testing::contents(path(name)); }

  static std::string refusal(const auto& call) {
    try {
      call();
    } catch (const Misuse& misuse) {
      return misuse.what();
    }
    return "";
  }

 private:
  TemporaryFolder folder_;
};

/// The examples of FIPS 180-4 (NIST, "SHA-256 examples"), and a million times the letter a.
TEST(Sha256, IsThatOfTheStandard) {
  EXPECT_EQ(sha256("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(sha256("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(sha256(std::string(1000000, 'a')),
            "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

TEST(Sha256, IsTheSameInPieces) {
  const std::string text(1000, 'x');
  for (const std::size_t size : {1u, 7u, 63u, 64u, 65u}) {
    Sha256 sum;
    for (std::size_t begin = 0; begin < text.size(); begin += size) sum.add(text.substr(begin, size));
    EXPECT_EQ(sum.hex(), sha256(text)) << size;
  }
}

TEST(ShownText, ControlCharactersAreEscaped) {
  EXPECT_EQ(shown_line("a\x1b[2Jb\r\nc\td"), "a\\u001b[2Jb\\u000d\\u000ac\td");
  EXPECT_EQ(shown_lines("a\nb\x07\x7f"), "a\nb\\u0007\\u007f");
  EXPECT_EQ(shown_line(std::string("a\0b", 3)), "a\\u0000b");
  EXPECT_EQ(shown_line("\xc2\x9b"
                       "31m"),
            "\\u009b31m")
      << "the control sequence introducer of C1";
  EXPECT_EQ(shown_line("\xe2\x80\xae"
                       "gnp.exe"),
            "\\u202egnp.exe")
      << "text from right to left";
}

TEST(ShownText, PrintableTextPassesAndOtherBytesAreEscaped) {
  EXPECT_EQ(shown_line("φ = ½ v², 速度 😀"), "φ = ½ v², 速度 😀");
  EXPECT_EQ(shown_line("\x9b"
                       "2J"),
            "\\x9b2J")
      << "a C1 byte of an 8-bit terminal";
  EXPECT_EQ(shown_line("\xc0\xaf \xed\xa0\x80 \xf4\x90\x80\x80 \xe2\x82"),
            "\\xc0\\xaf \\xed\\xa0\\x80 \\xf4\\x90\\x80\\x80 \\xe2\\x82")
      << "overlong, surrogate, too large, cut off";
}

TEST_F(Files, AreReadUpToALimit) {
  write("ten", "0123456789");
  EXPECT_EQ(read_file(path("ten"), "the file", 10), "0123456789");
  EXPECT_NE(refusal([&] { (void)read_file(path("ten"), "the file", 9); }).find("more than 9 bytes"),
            std::string::npos);
  write("empty", "");
  EXPECT_EQ(read_file(path("empty"), "the file", 0), "");
}

TEST_F(Files, DevicesPipesAndFoldersAreNotRead) {
  ASSERT_EQ(mkfifo(path("pipe").c_str(), 0600), 0);
  fs::create_symlink("/dev/zero", path("link"));
  for (const std::string& name : {std::string("/dev/zero"), path("link"), path("pipe"), path("")})
    EXPECT_NE(refusal([&] { (void)read_file(name, "the file", 100); }).find("no regular file"),
              std::string::npos)
        << name;
  EXPECT_NE(refusal([&] { (void)read_file(path("none"), "the file", 100); }).find("No such file"),
            std::string::npos);
}

TEST_F(Files, OneFileIsKnownUnderEverySpelling) {
  write("a", "");
  fs::create_directory(path("d"));
  fs::create_symlink(path("a"), path("link"));
  fs::create_hard_link(path("a"), path("hard"));
  fs::create_symlink("b", path("dangling"));
  for (const char* name : {"a", "./a", "d/../a", "link", "hard"})
    EXPECT_TRUE(same_file(path("a"), path(name))) << name;
  EXPECT_TRUE(same_file(path("b"), path("d/../b"))) << "not there yet";
  EXPECT_TRUE(same_file(path("b"), path("dangling")));
  EXPECT_FALSE(same_file(path("a"), path("b")));
  EXPECT_FALSE(same_file(path("a"), path("d/a")));
  EXPECT_FALSE(same_file("/dev/null", "/dev/null"));
}

TEST_F(Files, OutputsThatMeetAnythingElseAreRefused) {
  write("scene", "");
  EXPECT_NE(refusal([&] {
              require_outputs({{"--out", path("./scene")}}, {{"the scene", path("scene")}});
            }).find("--out and the scene are both"),
            std::string::npos);
  EXPECT_NE(refusal([&] {
              require_outputs({{"--out", path("x")}, {"--checkpoint", path("./x")}}, {});
            }).find("--checkpoint and --out are both"),
            std::string::npos);
  EXPECT_NE(refusal([&] {
              require_outputs({{"--out", path("none/x")}}, {});
            }).find("No such file"),
            std::string::npos);
  EXPECT_NE(refusal([&] {
              require_outputs({{"--out", path("")}}, {});
            }).find("Is a directory"),
            std::string::npos);
  EXPECT_EQ(refusal([&] { require_outputs({{"--out", path("x")}}, {{"the scene", path("scene")}}); }), "");
}

TEST_F(Files, WhatOneWritesNobodyElseOpens) {
  std::ofstream(path("x")) << "before";
  OutputFile first(path("x"), OutputFile::Mode::fresh);
  first.write("first");
  EXPECT_NE(refusal([&] { OutputFile second(path("x"), OutputFile::Mode::fresh); }).find("another run"),
            std::string::npos);
  EXPECT_EQ(contents("x"), "first") << "emptied by the one that was refused";
  first.close();
  OutputFile(path("x"), OutputFile::Mode::fresh).write("second");
  EXPECT_EQ(contents("x"), "second");
}

TEST_F(Files, ALockIsHeldOnceAndGoesWithItsOwner) {
  {
    const FileLock lock(path("c"));
    EXPECT_NE(refusal([&] { const FileLock second(path("c")); }).find("under way"), std::string::npos);
  }
  EXPECT_FALSE(fs::exists(path("c.lock")));
  write("c.lock", "of a process that was killed");
  { const FileLock lock(path("c")); }
  EXPECT_FALSE(fs::exists(path("c.lock")));
  write("victim", "");
  fs::create_symlink(path("victim"), path("c.lock"));
  EXPECT_NE(refusal([&] { const FileLock lock(path("c")); }), "");
}

TEST_F(Files, AReplacementFollowsNoLinkAndTakesLeftovers) {
  write("victim", "keep");
  fs::create_symlink(path("victim"), path("k.new"));
  EXPECT_NE(refusal([&] { replace_file(path("k"), "new"); }).find("k.new"), std::string::npos);
  EXPECT_EQ(contents("victim"), "keep");
  fs::remove(path("k.new"));
  write("k.new", "of a process that was killed");
  replace_file(path("k"), "new");
  EXPECT_EQ(contents("k"), "new");
  EXPECT_FALSE(fs::exists(path("k.new")));
}

TEST_F(Files, AReplacementKeepsThePermissions) {
  write("k", "old");
  ASSERT_EQ(chmod(path("k").c_str(), 0640), 0);
  replace_file(path("k"), "new");
  struct stat status {};
  ASSERT_EQ(stat(path("k").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777u, 0640u);
}

TEST_F(Files, APipeThatNobodyReadsIsRefused) {
  ASSERT_EQ(mkfifo(path("pipe").c_str(), 0600), 0);
  EXPECT_NE(
      refusal([&] { OutputFile file(path("pipe"), OutputFile::Mode::fresh); }).find("cannot be written"),
      std::string::npos);
  const int reader = open(path("pipe").c_str(), O_RDONLY | O_NONBLOCK);
  OutputFile(path("pipe"), OutputFile::Mode::fresh).write("x");
  char byte = 0;
  EXPECT_EQ(read(reader, &byte, 1), 1);
  close(reader);
}

}  // namespace
}  // namespace diracstep::testing
