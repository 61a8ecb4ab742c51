#pragma once

#include <vector>

#include "core/line/command.h"

namespace cairn::pipeline {

// The commands of the program besides those of the stages (stages/*/command.h), in the order of
// `cairn --help`.

// cairn import SOURCE -o CAPTURE: a public data set's layout, or a COLMAP model, as a capture
Command ImportCommand();
Command FeaturesCommand();
// cairn join NAME=FOLDER... -o FOLDER: several surveys as one capture
Command JoinCommand();
// cairn compile RECIPE.toml -o NAME.cairn: splits the recipe into a build folder and lets GNU Make run
// map.mk there
Command CompileCommand();
// cairn update-map OLD.cairn FOLDER|FILM|BAG -o NEW.cairn: a map and tonight's images as a recipe, compiled
Command UpdateMapCommand();
// cairn stage configure RECIPE.toml -o NAME.cairn --build-dir DIR: only splits the recipe, for Makefiles that
// include map.mk
Command ConfigureCommand();
// cairn pareto RECIPE.toml -o NAME.cairn [--sizes BYTES,...]
Command ParetoCommand();
// cairn clean MAP: removes the files that compiles left in a build folder, and no others
Command CleanCommand();

// cairn inspect MAP [--at X,Y[,HEADING] | --image NAME | --advice] [--json] [--svg FILE]
Command InspectCommand();
// cairn report MAP -o report.html
Command ReportCommand();
// cairn diff A B [--json]
Command DiffCommand();
// cairn export MAP|classes.db -o FOLDER: a COLMAP model of a map or of a survey's feature classes
Command ExportCommand();

// cairn localize MAP IMAGE... [--list FILE] [-o poses.txt] [--camera MODEL,W,H,P... | --cameras FILE]
// JSON lines on stdout, in the order of the images; IMAGE "-" reads names from stdin, answering one by one.
Command LocalizeCommand();
// cairn where MAP IMAGE... [--odometry FILE] [--json]: which places a sequence of images may be of
Command WhereCommand();
// cairn atlas MAP... -o FILE.atlas: one index of many maps
Command AtlasCommand();
// cairn plan locate VIEWS SCAN [--scan N] [--svg FILE]
Command LocateScanCommand();
// cairn plan follow VIEWS LOG [--start N] [--images LIST] [--svg FILE]
Command FollowScansCommand();
// cairn plan path VIEWS --from X,Y [--to X,Y] [--kind short|min-link|search] [--svg FILE]
Command PlanPathCommand();
// cairn plan tell-apart VIEWS --a X,Y,DEG --b X,Y,DEG [--svg FILE]
Command TellApartCommand();
// cairn plan next-look PLAN PLACES [--scan N] [--camera] [--svg FILE]
Command NextLookCommand();
// cairn route: a route from one survey image to another over the map's kept images
Command RouteCommand();
// cairn drive: a lost robot goes to a survey image in a simulated building
Command DriveCommand();

// cairn verify MAP [--public-key KEY.pub|RING] [--name NAME] [--min-epoch N]
Command VerifyCommand();
// cairn keygen KEY
Command KeygenCommand();
// cairn keys make NAME=KEY.pub... --threshold K [--after RING] -o RING
Command MakeKeysCommand();
// cairn keys sign RING --key KEY
Command SignKeysCommand();
// cairn keys show RING [--after RING]
Command ShowKeysCommand();
// cairn keys accept RING NEXT...
Command AcceptKeysCommand();
// cairn sign MAP --key KEY -o SIGNED [--epoch N | --after PREVIOUS [--public-key KEY.pub|RING]]
// cairn sign MAP --key KEY --add [-o SIGNATURES]
Command SignCommand();
// cairn update delta OLD NEW -o D [--key KEY] [--allow-older]
Command DeltaCommand();
// cairn update apply OLD D -o NEW [--public-key KEY.pub|RING] [--name NAME] [--min-epoch N] [--allow-older]
// [--signatures FILE]
// cairn update apply MAP D --in-place, likewise
Command ApplyCommand();
// cairn update rollback MAP [--public-key KEY.pub|RING] [--name NAME] [--min-epoch N]
Command RollbackCommand();
// cairn migrate OLD -o NEW
Command MigrateCommand();

// cairn manual -o FOLDER: manual pages, shell completion and the recipe's reference, for installing the
// program; --help does not list it
Command ManualCommand();

// All of them and the stages' own, under their headings.
std::vector<Command> AllCommands();

}  // namespace cairn::pipeline
