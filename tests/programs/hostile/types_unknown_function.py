launch_missiles(target="moon")
