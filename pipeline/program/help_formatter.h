#pragma once

#include <string>

#include <CLI/CLI.hpp>

namespace cairn::pipeline {

// Help as CLI11 has it, its texts broken into lines of at most 100 characters, and without the options under
// kMoreOptionsHeading, which --help-all shows.
class HelpFormatter : public CLI::Formatter {
 public:
  HelpFormatter();
  std::string make_help(const CLI::App* app, std::string name, CLI::AppFormatMode mode) const override;
  std::string make_option(const CLI::Option* option, bool is_positional) const override;
  std::string make_option_opts(const CLI::Option* option) const override;
  std::string make_option_desc(const CLI::Option* option) const override;
  std::string make_subcommand(const CLI::App* app) const override;
};

}  // namespace cairn::pipeline
