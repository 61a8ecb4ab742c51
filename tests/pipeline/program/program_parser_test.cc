#include "pipeline/program/program_parser.h"

#include <algorithm>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/line/memory.h"
#include "core/line/program_version.h"
#include "tests/pipeline/program/run_words.h"

namespace cairn::pipeline {
namespace {

using testing::HasSubstr;

TEST(Program, UsageErrorsExitWithTwoAndSayWhereHelpIs) {
  for (const std::vector<std::string>& words : {std::vector<std::string>{},
                                                {"stge"},
                                                {"stage", "--frobnicate"},
                                                {"stage", "--threads", "-1"},
                                                {"stage", "--progress", "dots"}}) {
    const Outcome outcome = RunStage(words, Nothing);
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_THAT(outcome.err, HasSubstr("--help"));
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  }
}

TEST(Program, UnknownCommandsAndOptionsNameTheNearest) {
  const auto message = [](const std::vector<std::string>& words) {
    const Outcome outcome = RunStage(words, Nothing);
    EXPECT_EQ(outcome.exit_code, 2);
    return outcome.err;
  };
  EXPECT_EQ(message({"stge"}), "cairn: no command 'stge'; did you mean 'stage'?; see cairn --help\n");
  EXPECT_EQ(message({"stge", "--threads", "3"}),
            "cairn: no command 'stge'; did you mean 'stage'?; see cairn --help\n");
  EXPECT_EQ(message({"frobnicate"}), "cairn: no command 'frobnicate'; see cairn --help\n");
  EXPECT_EQ(message({"stage", "--thread", "3"}),
            "cairn stage: no option '--thread'; did you mean '--threads'?; see cairn stage --help\n");
  EXPECT_EQ(message({"stage", "--theads=3"}),
            "cairn stage: no option '--theads'; did you mean '--threads'?; see cairn stage --help\n");
  EXPECT_EQ(message({"stage", "--frobnicate"}),
            "cairn stage: no option '--frobnicate'; see cairn stage --help\n");
  EXPECT_THAT(message({}), HasSubstr("cairn: give a command; see cairn --help"));
  EXPECT_THAT(message({"--frobnicate"}), HasSubstr("see cairn --help"));
}

TEST(Program, AWordTooManyIsNotTakenForAnOption) {
  EXPECT_EQ(RunStage({"stage", "extra", "--frobnicate"}, Nothing).err,
            "cairn stage: no option '--frobnicate'; see cairn stage --help\n");
  const Outcome outcome = RunStage({"stage", "extra"}, Nothing);
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, testing::Not(HasSubstr("no option")));
}

// An unknown option is reported before a missing one.
TEST(Program, UnknownOptionIsNamedBesideAMissingArgument) {
  std::string map;
  const Outcome outcome =
      RunWords({{.name = "stage",
                 .summary = "Needs an argument",
                 .add_arguments = [&](ArgumentParser& parser) { parser.Add("map", map, "Map").Required(); },
                 .run = Nothing}},
               {"stage", "--sed", "3"});
  EXPECT_EQ(outcome.err, "cairn stage: no option '--sed'; did you mean '--seed'?; see cairn stage --help\n");
}

TEST(Program, HelpAndVersionAreOnEverySubcommand) {
  EXPECT_THAT(RunStage({"--help"}, Nothing).out, HasSubstr("Does what the test says"));
  EXPECT_THAT(RunStage({"stage", "--help"}, Nothing).out, HasSubstr("--threads"));
  EXPECT_EQ(RunStage({"stage", "--version"}, Nothing).out, std::string("cairn ") + ProgramVersion() + "\n");
  EXPECT_EQ(RunStage({"stage", "--help"}, Nothing).exit_code, 0);
}

// `plan locate`, `plan path`, once called locate-scan, `check`, and one that is not listed.
std::vector<Command> Families(std::string* done, std::string* text) {
  const auto command = [=](const std::string& name, const std::string& summary) {
    return Command{.name = name,
                   .summary = summary,
                   .add_arguments =
                       [=](ArgumentParser& parser) {
                         parser.Add("--seldom", *text, "Is seldom wanted").Type("WORD").OnlyInHelpAll();
                         parser.Add("--kind", *text, "Which one").OneOf({"short", "long"}).ShowDefault();
                       },
                   .run =
                       [=](const CommandEnvironment&) {
                         *done = name;
                         return name == "locate" ? Status(Error{ErrorCode::kNoData, "no scan"}) : Ok();
                       }};
  };
  Command locate = command("locate", "Find the scan");
  locate.former_names = {"locate-scan"};
  Command check = command("check", std::string(90, 'a') + " " + std::string(60, 'b'));
  check.heading = "What a map holds";
  Command manual = command("manual", "For who installs it");
  manual.heading = "";
  return {check,
          {.name = "plan", .summary = "Plans", .subcommands = {locate, command("path", "Find a way")}},
          manual};
}

TEST(Program, MemoryIsWhatIsGivenElseTheMachines) {
  int64_t memory_mib = 0;
  bool is_given = false;
  const auto run = [&](const std::vector<std::string>& words) {
    return RunStage(words, [&](const CommandEnvironment& environment) -> Status {
      memory_mib = environment.memory_mib;
      is_given = environment.memory_given;
      return Ok();
    });
  };
  EXPECT_EQ(run({"stage", "--memory", "1"}).exit_code, 0);
  EXPECT_EQ(memory_mib, 1);
  EXPECT_TRUE(is_given);
  EXPECT_EQ(run({"stage"}).exit_code, 0);
  EXPECT_EQ(memory_mib, DefaultMemoryMib());
  EXPECT_FALSE(is_given);
}

TEST(Program, LongHelpGoesOnBelowItselfAtTheSameColumnAndFillsItsLines) {
  std::string text;
  // Of 70 characters: a line of 100 is full.
  const std::string line = "aaaa bbbb cccc dddd eeee ffff gggg hhhh iiii jjjj kkkk llll mmmm nnnnn";
  const std::string words = line + " " + line + " oooo";
  const Command command = {.name = "check",
                           .summary = "Checks",
                           .add_arguments =
                               [&](ArgumentParser& parser) {
                                 parser.Add("--short", text, words).Type("WORD");
                                 parser.Add("--much-longer-than-the-column", text, words).Type("WORD");
                               },
                           .run = Nothing};
  const std::string help = RunWords({command}, {"check", "--help"}).out;
  const std::string column(30, ' ');
  EXPECT_THAT(help, HasSubstr("  --short WORD                " + line + "\n" + column + line + "\n" + column +
                              "oooo\n"));
  EXPECT_THAT(help, HasSubstr("  --much-longer-than-the-column WORD\n" + column + line + "\n" + column +
                              line + "\n" + column + "oooo\n"));
}

TEST(Program, HelpOfAListSaysOnceThatItIsOne) {
  std::vector<std::string> names, files;
  const Command command = {.name = "check",
                           .summary = "Checks",
                           .add_arguments =
                               [&](ArgumentParser& parser) {
                                 parser.Add("--names", names, "Names").SeparatedByCommas().Type("NAME,...");
                                 parser.Add("--files", files, "Files").Type("FILE");
                               },
                           .run = Nothing};
  const std::string help = RunWords({command}, {"check", "--help"}).out;
  EXPECT_THAT(help, HasSubstr("  --names NAME,...            Names\n"));
  EXPECT_THAT(help, HasSubstr("  --files FILE...             Files\n"));
}

TEST(Program, CommandsOfTwoWordsAreRunAndNamedByBoth) {
  std::string done, text = "short";
  const std::vector<Command> commands = Families(&done, &text);
  EXPECT_EQ(RunWords(commands, {"plan", "path"}).exit_code, 0);
  EXPECT_EQ(done, "path");
  const Outcome failed = RunWords(commands, {"plan", "locate", "--threads", "1"});
  EXPECT_EQ(failed.err, "cairn plan locate: no scan\n");
  EXPECT_EQ(failed.exit_code, static_cast<int>(ErrorCode::kNoData));
  EXPECT_EQ(RunWords(commands, {"plan", "path", "--kind", "middling"}).exit_code, 2);
}

TEST(Program, AWrongWordIsAnsweredWithTheNearestCommandWhereverItStands) {
  std::string done, text;
  const auto message = [&](const std::vector<std::string>& words) {
    const Outcome outcome = RunWords(Families(&done, &text), words);
    EXPECT_EQ(outcome.exit_code, 2);
    return outcome.err;
  };
  EXPECT_EQ(message({"plan", "lokate"}),
            "cairn plan: no command 'plan lokate'; did you mean 'plan locate'?; see cairn plan --help\n");
  EXPECT_EQ(message({"locate"}),
            "cairn: no command 'locate'; did you mean 'plan locate'?; see cairn --help\n");
  EXPECT_EQ(message({"locate-scan", "x"}),
            "cairn: no command 'locate-scan'; did you mean 'plan locate'?; see cairn --help\n");
  EXPECT_EQ(message({"plan", "check"}),
            "cairn plan: no command 'plan check'; did you mean 'check'?; see cairn plan --help\n");
  EXPECT_EQ(message({"plan"}), "cairn plan: give a command; see cairn plan --help\n");
  EXPECT_EQ(message({"plan", "path", "--kin"}),
            "cairn plan path: no option '--kin'; did you mean '--kind'?; see cairn plan path --help\n");
}

TEST(Program, HelpIsShortAndHelpAllIsWhole) {
  std::string done, text = "short";
  const auto help = [&](const std::vector<std::string>& words) {
    const Outcome outcome = RunWords(Families(&done, &text), words);
    EXPECT_EQ(outcome.exit_code, 0);
    std::istringstream lines(outcome.out);
    for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 120u) << line;
    return outcome.out;
  };
  const std::string program = help({"--help"});
  EXPECT_THAT(program, HasSubstr("\nWhat a map holds:\n  check               " + std::string(90, 'a') + "\n" +
                                 std::string(22, ' ') + std::string(60, 'b') + "\n"));
  EXPECT_THAT(program, HasSubstr("\nCommands:\n  plan                Plans\n"));
  EXPECT_EQ(program.find("manual"), std::string::npos);
  EXPECT_EQ(program.find("locate"), std::string::npos);
  EXPECT_THAT(help({"plan", "--help"}), HasSubstr("  locate              Find the scan\n"));
  const std::string path = help({"plan", "path", "--help"});
  EXPECT_THAT(path, HasSubstr("Usage: cairn plan path [OPTIONS]"));
  EXPECT_THAT(path, HasSubstr("  --kind WORD                 Which one [short]\n"));
  EXPECT_EQ(path.find("--seldom"), std::string::npos);
  EXPECT_THAT(path, HasSubstr(" more: cairn plan path --help-all\n"));
  EXPECT_THAT(help({"plan", "path", "--help-all"}),
              HasSubstr("  --seldom WORD               Is seldom wanted\n"));
}

}  // namespace
}  // namespace cairn::pipeline
