#pragma once

#include <vector>

#include "core/line/command.h"

namespace cairn::pipeline {

// The subcommands of the program beside the stages' own (stages/*/command.h).

// Maps from surveys.

// `cairn import SOURCE -o CAPTURE`: a public data set's layout, or a COLMAP model, as a capture.
Command ImportCommand();

// `cairn join-captures NAME=FOLDER... -o FOLDER`: several surveys as one capture.
Command JoinCapturesCommand();

// `cairn compile RECIPE.toml -o NAME.cairn`: splits the recipe into a build folder and lets GNU Make run
// map.mk there.
Command CompileCommand();
// `cairn configure RECIPE.toml -o NAME.cairn --build-dir DIR`: only splits the recipe, for Makefiles that
// include map.mk.
Command ConfigureCommand();
// `cairn recipe-reference`: prints docs/recipe.md.
Command RecipeReferenceCommand();

// `cairn clean`: removes what compiles left in a build folder, and nothing that somebody else put there.
Command CleanCommand();

// cairn pareto RECIPE.toml -o NAME.cairn [--sizes BYTES,...]
Command ParetoCommand();

// Maps to robots.

// cairn localize MAP IMAGE... [--list FILE] [-o poses.txt] [--camera MODEL,W,H,P... | --cameras FILE]
// JSON lines on stdout, in the order of the images; IMAGE "-" reads names from stdin, answering one by one.
Command LocalizeCommand();

// cairn route: a way from one survey image to another over the map's kept images.
Command RouteCommand();

// cairn drive: a lost robot goes to a survey image in a simulated building.
Command DriveCommand();

// cairn locate-scan VIEWS SCAN [--scan N] [--svg FILE]
Command LocateScanCommand();

// cairn plan-path VIEWS --from X,Y [--to X,Y] [--kind short|min-link|search] [--svg FILE]
Command PlanPathCommand();
// cairn tell-apart VIEWS --a X,Y,DEG --b X,Y,DEG [--svg FILE]
Command TellApartCommand();

// What a map holds.

// cairn inspect MAP [--json] [--svg FILE]: what is in a map, and what it costs.
Command InspectCommand();

// cairn explain MAP [--at X,Y[,HEADING] | --image NAME] [--build-dir DIR] [--json]
Command ExplainCommand();

// cairn diff A B [--json]
Command DiffCommand();

// cairn report MAP -o report.html
Command ReportCommand();

// `cairn export MAP|classes.db -o FOLDER`: a COLMAP model of a map or of a survey's feature classes.
Command ExportCommand();

// Releases.

// cairn verify MAP [--public-key KEY.pub] [--name NAME] [--min-epoch N]
Command VerifyCommand();
// cairn keygen KEY
Command KeygenCommand();
// cairn sign MAP --key KEY -o SIGNED [--epoch N | --after PREVIOUS]
Command SignCommand();
// cairn migrate OLD -o NEW
Command MigrateCommand();

// cairn delta OLD NEW -o D [--key KEY] [--allow-older]
Command DeltaCommand();
// cairn apply OLD D -o NEW [--public-key KEY.pub] [--name NAME] [--min-epoch N] [--allow-older]
// cairn apply MAP D --in-place, likewise
Command ApplyCommand();
// cairn rollback MAP [--public-key KEY.pub] [--name NAME] [--min-epoch N]
Command RollbackCommand();

// The manual.

// `cairn manual -o FOLDER`: manual pages and shell completion of the whole program, for who installs it.
Command ManualCommand();

// Every subcommand of the program, the line's stages first and in its order.
std::vector<Command> AllCommands();

}  // namespace cairn::pipeline
