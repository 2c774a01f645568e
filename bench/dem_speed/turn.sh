# turn.sh ENGINE ROUND, called by the decks between their runs: where a study times several engines in one go (ACOPLA_TURNS is set), waits
# until it is this one's turn, so that they are timed one after another, round by round, and each settles its bed once. It waits in the
# opening of a pipe, where it takes no time from whoever has the turn.
[ -n "$ACOPLA_TURNS" ] || exit 0
mkfifo "go-$1-$2"
touch "waiting-$1-$2"
read -r _ < "go-$1-$2"
